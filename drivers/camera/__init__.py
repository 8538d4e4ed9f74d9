"""Cameras and printed markers: pictures, corners and poses."""
