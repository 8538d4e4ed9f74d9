"""Where the object truly was, by the marker camera."""
