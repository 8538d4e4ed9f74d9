"""The default method: several trajectories, smoothed together with the shape."""
