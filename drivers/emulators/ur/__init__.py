"""An emulated control box of Universal Robots: RTDE, dashboard and program ports over a plant."""
