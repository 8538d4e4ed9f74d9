"""Choice of the shape model by evidence."""
