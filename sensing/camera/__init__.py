"""Camera model: projection of endcap points to pixels and back, the camera's pose, and the nominal camera."""
