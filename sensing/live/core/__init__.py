"""Core of a run: configuration, feeds of frames, the pipeline of one endcap, and the loop over all endcaps."""
