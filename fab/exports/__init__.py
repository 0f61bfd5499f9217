"""The export folder: meshes, solids, assemblies, pictures, manifest."""
