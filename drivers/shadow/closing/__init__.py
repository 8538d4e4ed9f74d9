"""How the hand closes: postures with the fingertips on straight lines, and where the links are then."""
