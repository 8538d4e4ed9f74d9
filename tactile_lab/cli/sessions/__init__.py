"""Recorded sessions at the command line."""
