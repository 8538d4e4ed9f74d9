"""How much is known, and how much an action would tell (thesis section 4.4)."""
