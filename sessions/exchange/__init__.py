"""Sessions and contacts in the forms of other programs."""
