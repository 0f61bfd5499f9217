"""Frames of up to many endcaps to wrenches and contacts while they are touched: ``python -m sensing.live``."""
