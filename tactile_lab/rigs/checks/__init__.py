"""Checks whether a rig is ready, without moving it."""
