"""What the thesis's text leaves open, and its figures made again."""
