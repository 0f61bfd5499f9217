"""Points of the endcap in, pixels out, and back: the lens, where it sits, and the nominal camera."""
