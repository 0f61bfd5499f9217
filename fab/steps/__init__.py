"""How mold and endcap are put together and taken apart: one list of steps for sweeps, words and pictures."""
