"""Estimates pose, velocity and shape of a tensegrity robot, and which of its endcaps hold, from their wrenches."""
