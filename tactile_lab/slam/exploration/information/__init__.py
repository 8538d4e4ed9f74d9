"""Measures of uncertainty and information gain (thesis section 4.4)."""
