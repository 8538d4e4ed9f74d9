"""Frames, transforms, contacts and grasps: the words the rest of the program speaks in."""
