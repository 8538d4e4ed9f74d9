"""Choice of the most informative grasp (thesis chapter 4)."""
