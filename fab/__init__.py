"""From solids to files that can be printed: meshes, checks, pictures, exports."""
