"""``python -m sensing.robot``."""

from sensing.live.ending import end_at_once, leave

if __name__ == "__main__":
    end_at_once()
    from sensing.robot.node.cli import main

    leave(main())
