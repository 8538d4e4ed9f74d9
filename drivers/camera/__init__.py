"""Cameras and printed markers: pictures, corners, poses."""
