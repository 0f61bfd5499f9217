"""One endcap as a body of robot simulators: springs of :mod:`sensing`, shape and masses of :mod:`cad`."""
