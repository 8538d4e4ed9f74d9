"""Odometry in the hand: how the object moved while it was held, from what the fingertips felt."""
