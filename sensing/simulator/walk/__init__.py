"""Simulates a tensegrity robot that rolls over terrain in MuJoCo, and the samples of its sensors."""
