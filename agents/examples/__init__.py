"""Training without Stable-Baselines3: to read, to run, and to copy from."""
