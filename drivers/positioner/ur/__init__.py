"""Arms of Universal Robots (e-Series and CB3) through the package ur-rtde, in a process of its own."""
