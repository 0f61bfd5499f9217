"""Frames of several endcaps to readings: configuration, sources, the pipeline and its loop."""
