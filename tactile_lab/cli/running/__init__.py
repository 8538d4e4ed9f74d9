"""``tactile-lab run`` and ``sweep``, and who is present."""
