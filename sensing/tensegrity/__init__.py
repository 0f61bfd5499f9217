"""What a tensegrity robot is and what its sensors report: records that simulator and estimator share."""
