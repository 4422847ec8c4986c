"""Motion of one spacecraft around the Earth: orbits, elements, frames, ephemerides and accelerations."""
