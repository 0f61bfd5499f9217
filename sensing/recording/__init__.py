"""Records frames with the readings of a force/torque sensor as a folder of labelled frames."""
