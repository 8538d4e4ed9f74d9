"""Plans for an object that stays where it stands."""
