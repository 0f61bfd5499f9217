"""The silicone solid: elements, meshes, elasticity, rate effects and the linear solver (N, mm, MPa)."""
