"""How costs move: the front of thrust against error, and robustness against what differs from the plan."""
