"""The simulated rig: one physics behind the bytes of all devices."""
