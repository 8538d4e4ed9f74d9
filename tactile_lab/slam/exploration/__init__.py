"""Which grasp would tell most (thesis chapter 4)."""
