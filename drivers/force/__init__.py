"""Vendor-independent force fingertips: bias, weight, load, and contact from a wrench."""
