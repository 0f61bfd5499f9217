"""``python -m endcap``, the same as the command ``endcap``."""

from endcap.command import program

if __name__ == "__main__":
    program()
