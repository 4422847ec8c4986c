"""What is flown and how it is scored: scenarios, schedules, rewards and observations."""
