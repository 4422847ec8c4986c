"""Learned policies in numpy: networks, throttle, and the library of shipped ones."""
