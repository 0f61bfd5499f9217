"""Page with sliders for D and T: shape, mass and price of an endcap at once, and a button that makes its files."""
