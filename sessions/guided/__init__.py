"""Sessions that a person leads."""
