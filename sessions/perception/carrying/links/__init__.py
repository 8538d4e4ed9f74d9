"""Links that push the object: they feel nothing, but their motors work."""
