"""The likelihood of a whole trajectory, the shape integrated out."""
