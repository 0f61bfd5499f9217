"""Frames and a force/torque stream in, a folder of labelled frames out."""
