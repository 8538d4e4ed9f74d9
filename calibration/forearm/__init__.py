"""Pose of the forearm's mount in the world."""
