"""Smooth fields: Gaussian process implicit surfaces."""
