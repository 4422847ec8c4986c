"""Flights of policies in many processes, kept on disk, and their statistics."""
