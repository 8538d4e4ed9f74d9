"""Results that the repository keeps, and the pages that are made of them."""
