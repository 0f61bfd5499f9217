"""Library of solved presses (level 4): fit, evaluation, and the level that the simulator offers."""
