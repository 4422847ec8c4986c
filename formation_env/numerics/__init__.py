"""Array types, compiled arithmetic and random streams: no physics."""
