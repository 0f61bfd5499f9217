"""Labelled, rendered data sets: ``python -m sensing.simulator data``."""
