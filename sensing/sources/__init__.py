"""Sources of frames: camera, file, folder, network, or a warped or drawn picture. All give the same record."""
