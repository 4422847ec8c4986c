"""Training runs: settings, folders, checkpoints, validation."""
