"""The page to turn two knobs: shape, mass and price of an endcap at once, its files by the command that makes them."""
