"""Touches without a grasp: taps, probes from the side, and the bounding box they give."""
