"""``python -m sensing.robot``."""

from __future__ import annotations

from collections.abc import Sequence

from sensing.live.ending import end_at_once, leave


def main(arguments: Sequence[str] | None = None) -> int:
    """Run the command line; returns the exit status."""
    from sensing.robot.node.cli import main as run

    return run(arguments)


if __name__ == "__main__":
    end_at_once()
    leave(main())
