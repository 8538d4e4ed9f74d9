"""How hand and positioner move, and what stops them."""
