"""Pictures of a flight. Only `renderer` and what it imports need matplotlib; they are imported when first used."""
