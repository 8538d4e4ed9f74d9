"""``tactile-lab run`` and ``sweep``."""
