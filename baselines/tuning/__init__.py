"""Search of policy settings: the same procedure and budget for every policy that has a search space."""
