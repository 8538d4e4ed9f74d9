"""Bytes of the palm, its motors and its fingertips."""
