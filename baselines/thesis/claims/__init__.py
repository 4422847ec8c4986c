"""Claims of the source thesis, each tested on simulated flights."""
