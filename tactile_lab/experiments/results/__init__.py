"""Results stored in the repository, and the pages made from them."""
