"""Where the forearm's mount stands in the world."""
