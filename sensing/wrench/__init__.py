"""Shear field in, wrench with covariance out; filtered, and with it whether and where the endcap is touched."""
