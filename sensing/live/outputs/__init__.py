"""Where readings go: terminal, JSON lines, recordings, ROS 2 topics, viewers."""
