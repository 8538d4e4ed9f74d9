"""From received bytes to samples, contacts and grasps, live and in a replay alike."""
