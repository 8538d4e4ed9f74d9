"""Poses from the corners of flat things: squares, boards, and both markers of the table together."""
