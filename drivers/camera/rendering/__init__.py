"""Rendered pictures of markers and boards, as a camera would take them, without a physics engine."""
