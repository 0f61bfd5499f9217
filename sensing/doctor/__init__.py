"""Finds faults of a camera and its picture, and says how to fix them: ``python -m sensing.sources check``."""
