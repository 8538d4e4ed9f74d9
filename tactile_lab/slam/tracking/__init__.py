"""The object's pose through successive grasps (thesis chapter 3)."""
