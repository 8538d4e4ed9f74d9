"""Solids of flat faces, and prisms."""
