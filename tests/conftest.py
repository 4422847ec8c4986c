"""Settings of all tests."""

import os
import signal

from hypothesis import settings

# Read when numpy is loaded, which is later: 6 x 6 matrices gain nothing from threads, and the workers would wait for
# each other's.
os.environ["OPENBLAS_NUM_THREADS"] = "1"

# The same examples on every run; a numba compile may take longer than any deadline.
settings.register_profile("deterministic", derandomize=True, deadline=None, max_examples=25, database=None)
settings.load_profile("deterministic")

# A shell that starts this in the background has Ctrl-C ignored, and so would all that the tests start.
signal.signal(signal.SIGINT, signal.default_int_handler)
