"""Outputs of a run: terminal, JSON lines, recordings, ROS 2 topics, viewers."""
