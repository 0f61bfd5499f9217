"""Scales a few solved shells to any design and silicone: units, library, labelled sets."""
