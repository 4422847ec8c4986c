"""Baselines for several followers: architectures, avoidance, and who flies where."""
