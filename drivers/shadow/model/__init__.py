"""What the hand is like: kinematics, links, motors, joint calibration, gains."""
