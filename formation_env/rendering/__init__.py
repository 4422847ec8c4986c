"""Frames of a flight. Only `renderer` and its imports need matplotlib; they are imported at the first frame."""
