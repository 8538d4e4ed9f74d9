"""What a fingertip can get to by the hand's geometry, and what is known of it."""
