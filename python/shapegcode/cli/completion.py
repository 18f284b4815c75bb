"""``shapegcode completion``: the script that has a shell complete at TAB, and what it then offers.

The shell asks the command itself at each TAB: what is offered is what the parser of this version takes.
"""

from __future__ import annotations

import argparse
import os
import sys

_SHELLS = ("bash", "zsh", "fish")


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Declare the arguments."""
    parser.description = (
        "Prints the script that has a shell complete commands, options, their values and files at TAB. Put into "
        '~/.bashrc or ~/.zshrc:\n\n  eval "$(shapegcode completion bash)"\n\nor zsh in place of bash; into '
        "~/.config/fish/config.fish:\n\n  shapegcode completion fish | source"
    )
    parser.add_argument("shell", choices=_SHELLS, help="your shell")


def run(args: argparse.Namespace) -> int:
    """Print the script."""
    from argcomplete.shell_integration import shellcode

    sys.stdout.write(shellcode(["shapegcode"], shell=args.shell))
    return 0


def complete() -> None:
    """Print the completions for a shell, and end the process."""
    import argcomplete

    from shapegcode.cli import COMMANDS, parser_of

    words = os.environ.get("COMP_LINE", "").split()
    names = {command.name for command in COMMANDS}
    selected = next((word for word in words[1:] if word in names), None)
    argcomplete.autocomplete(parser_of(selected))
