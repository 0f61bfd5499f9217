"""Calibration by weight: one gain an endcap from known weights, and from a robot's own."""
