"""Hyperparameter search: trainings from one pretrained actor, compared on validation seeds."""
