"""Force fingertips of any make: bias, weight, load, and the contact that a wrench tells."""
