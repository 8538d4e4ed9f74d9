"""Solids with flat faces, and prisms."""
