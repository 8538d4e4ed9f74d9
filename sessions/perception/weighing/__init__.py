"""Physical properties of the object: mass and centre from a lift, friction from what slid."""
