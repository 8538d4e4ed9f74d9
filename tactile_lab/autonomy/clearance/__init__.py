"""Keeps links of the hand off an object that is estimated, or of which contacts alone are known."""
