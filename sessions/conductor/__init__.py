"""A session, grasp after grasp; the protocols of estimator and decision maker."""
