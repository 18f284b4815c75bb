"""``python -m shapegcode``: the command."""

import sys

__all__ = ["main"]


def main() -> int:
    """Run the command; Ctrl-C while it loads ends it in words too.

    Returns:
        The exit code.
    """
    try:
        from shapegcode.cli import main as command

        return command()
    except KeyboardInterrupt:
        print("shapegcode: stopped", file=sys.stderr)
        return 130


if __name__ == "__main__":
    sys.exit(main())
