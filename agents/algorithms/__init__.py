"""Learning algorithms: PPO and SAC of Stable-Baselines3, adapted to the environments."""
