"""A simulated endcap: mechanics, light and camera. Shares nothing with the estimator but the camera model."""
