"""Ground truth of the object's pose from the marker camera."""
