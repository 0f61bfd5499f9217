"""``python -m sensing.live``."""

from sensing.live.ending import end_at_once, leave

if __name__ == "__main__":
    end_at_once()
    from sensing.live.cli import main

    leave(main())
