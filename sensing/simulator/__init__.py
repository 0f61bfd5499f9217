"""A simulator of the endcap: shell mechanics, contact, light and camera. Shares only the camera model with sensing."""
