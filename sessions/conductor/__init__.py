"""A session, grasp after grasp; the protocols of whoever estimates and decides."""
