"""The three-bar robot on its endcaps: statics, a solved scene and its pictures."""
