"""The way in: the command ``endcap``. Importing this loads the standard library only."""
