"""The endcap for robot simulators: a sphere on springs, fitted to the pressed shell, as MJCF (m, N, kg, s)."""
