"""The command `dubins_rrt`, which is `python -m dubins_rrt_ros` too. It imports nothing before Ctrl-C is heeded."""

import sys


def main() -> int:
    """Run the command line of the process, and return the exit status."""
    try:
        from dubins_rrt_ros.cli.main import main as run
    except KeyboardInterrupt:
        print("dubins_rrt: interrupted", file=sys.stderr)
        return 130
    return run()


if __name__ == "__main__":
    sys.exit(main())
