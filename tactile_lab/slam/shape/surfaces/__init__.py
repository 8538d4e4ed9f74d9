"""Contours and meshes: extraction, sampling, support."""
