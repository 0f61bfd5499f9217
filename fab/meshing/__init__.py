"""Triangle meshes of solids, and the gyroid, which exists as a mesh only."""
