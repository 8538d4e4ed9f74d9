"""The files of a folder of results."""
