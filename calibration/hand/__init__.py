"""Joint offsets and gains of the hand."""
