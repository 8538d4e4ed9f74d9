"""Sessions and contacts in formats for other programs."""
