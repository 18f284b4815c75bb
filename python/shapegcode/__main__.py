"""``python -m shapegcode``: the command."""

import sys
from typing import Any

__all__ = ["main"]

_ONCE_MORE_S = 0.01


def main() -> int:
    """Run the command; Ctrl-C during loading also ends it with a message.

    Returns:
        The exit code.
    """
    sys.unraisablehook = _interrupt_once_more
    try:
        from shapegcode.cli import main as command

        return command()
    except KeyboardInterrupt:
        print("shapegcode: stopped", file=sys.stderr)
        return 130


def _interrupt_once_more(lost: Any) -> None:
    """Interrupt again after a finalizer, in which Python ignores exceptions."""
    if lost.exc_type is not KeyboardInterrupt:
        sys.__unraisablehook__(lost)
        return
    import signal
    from threading import Timer

    Timer(_ONCE_MORE_S, signal.raise_signal, (signal.SIGINT,)).start()


if __name__ == "__main__":
    sys.exit(main())
