"""Sessions for other people's viewers: Foxglove and Lichtblick, Rerun, and ROS 2 bags.

:mod:`~tactile_lab.viewers.story` turns what is recorded into frames, joints, contacts and surfaces without any format;
each format writes those.
"""
