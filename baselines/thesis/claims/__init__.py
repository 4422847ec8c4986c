"""The source thesis's claims, each tested on flights."""
