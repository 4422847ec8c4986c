"""Search of gains: the same procedure and budget for every policy that has free settings."""
