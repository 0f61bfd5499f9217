"""Solids to triangle meshes, and the gyroid that exists as a mesh only."""
