"""PPO and SAC of Stable-Baselines3, fitted to the environments."""
