"""Runs endcaps: frames of one or more cameras to wrenches and contacts, ``python -m sensing.live``."""
