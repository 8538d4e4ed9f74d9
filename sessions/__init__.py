"""Recording, replaying and conducting sessions, whoever estimates and decides."""
