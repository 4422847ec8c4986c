"""Settings of all tests."""

from hypothesis import settings

# The same examples on every run; a numba compile may take longer than any deadline.
settings.register_profile("deterministic", derandomize=True, deadline=None, max_examples=25, database=None)
settings.load_profile("deterministic")
