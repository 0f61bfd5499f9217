"""Slicer projects, slicing, and what the G-code really prints."""
