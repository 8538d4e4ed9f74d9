"""What all prints have in common, and the boards that other programs print: chessboards and AprilGrids."""
