"""Steps of assembly and disassembly of mold and endcap: one list for sweeps, instructions and pictures."""
