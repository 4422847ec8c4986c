"""Rendering modes and frame rate, as in the environments' metadata; needs no matplotlib."""

from typing import Final

RENDER_MODES: Final = ("rgb_array", "human")
"""An image as an array, or a window."""
FRAMES_PER_S: Final = 20
"""Frames per second of a window and of a recorded video."""
