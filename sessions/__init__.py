"""Recording, replaying and conducting sessions, with any estimator and any decision maker."""
