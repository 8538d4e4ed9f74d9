"""Trajectories smoothed together with flat faces."""
