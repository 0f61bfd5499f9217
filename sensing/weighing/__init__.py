"""Calibration by weight: one gain for each endcap from known weights, or from the weight of a robot."""
