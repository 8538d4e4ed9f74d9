"""Distances between shapes (thesis appendix C)."""
