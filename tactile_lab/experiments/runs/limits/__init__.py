"""How well it can be done at best: bounds on tracking, shape and exploration."""
