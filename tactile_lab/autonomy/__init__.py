"""Decisions for the hand: planners, candidates, regrasping, and the estimator's service and process."""
