"""Estimates lens and pose of the camera from photos of the dots or of a calibration board."""
