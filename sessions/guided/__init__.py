"""Sessions led by a person."""
