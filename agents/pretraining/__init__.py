"""What a policy learns before reinforcement learning: from a classical policy, then from the model's gradient."""
