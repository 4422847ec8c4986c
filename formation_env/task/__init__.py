"""Tasks: scenarios, schedules, rewards and observations."""
