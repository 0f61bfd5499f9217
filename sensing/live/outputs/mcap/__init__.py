"""Recordings: MCAP files with ROS 2 schemas."""
