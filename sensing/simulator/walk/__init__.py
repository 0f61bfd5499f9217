"""A tensegrity robot that rolls over terrain in MuJoCo, and what its sensors report on the way."""
