"""Emulated ATI electronics, as seen by their clients."""
