"""Which model describes an object best, by evidence."""
