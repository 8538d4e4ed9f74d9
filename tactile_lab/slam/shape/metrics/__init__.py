"""How far shapes are from each other (thesis appendix C)."""
