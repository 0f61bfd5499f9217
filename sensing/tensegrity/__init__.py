"""Records that simulator and estimator share: the description of a tensegrity robot and samples of its sensors."""
