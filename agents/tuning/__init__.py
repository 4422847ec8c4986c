"""Search of hyperparameters: trainings from one pretrained actor, judged on validation seeds."""
