"""Training before reinforcement learning: imitation of a classical policy, then gradient descent through the model."""
