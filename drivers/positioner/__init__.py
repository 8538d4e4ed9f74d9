"""The six-axis positioner that carries the hand."""
