"""``shapegcode machine``: write a machine file to start from, import one, or explain the values of one."""

from __future__ import annotations

import argparse
import sys

from shapegcode.cli.console import add_json_argument

__all__ = ["add_arguments", "run"]

_DEFAULT_FILE = "machine.toml"
_DEFAULT_MACHINE = "vx500"


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Declare ``init``, ``import`` and ``show``."""
    parser.epilog = "example: shapegcode machine import CNC-PARA.TXT --from vx500 -o machine.toml"
    actions = parser.add_subparsers(dest="action", metavar="ACTION", required=True, title="actions")

    init = actions.add_parser("init", help="write a commented machine file to start from")
    init.add_argument(
        "name",
        metavar="NAME",
        nargs="?",
        default=_DEFAULT_MACHINE,
        help="built-in machine to start from (default: %(default)s)",
    )
    init.add_argument(
        "-o",
        "--output",
        metavar="FILE",
        default=_DEFAULT_FILE,
        help="file to write (default: %(default)s); - for standard output",
    )
    init.add_argument("--force", action="store_true", help="overwrite an existing file")

    take = actions.add_parser(
        "import",
        help="make a machine file from a controller's parameter dump (CNC-PARA.TXT)",
        description="Make a machine file from a FANUC parameter dump, and say what was read, assumed and missing.",
        epilog="example: shapegcode machine import CNC-PARA.TXT --from vx500 -o machine.toml",
    )
    take.add_argument("dump", metavar="DUMP", help="parameter dump as the controller punches it")
    take.add_argument(
        "-o", "--output", metavar="FILE", default=_DEFAULT_FILE, help="file to write (default: %(default)s)"
    )
    take.add_argument(
        "--from", dest="base", metavar="MACHINE", help="machine for what the dump does not say, such as the modes"
    )
    take.add_argument("--force", action="store_true", help="overwrite an existing file")
    add_json_argument(take)

    show = actions.add_parser(
        "show",
        help="print every value with its unit, origin and meaning",
        description="Print every value with its unit, meaning and origin: file, default, or "
        "assumed for a default that is an assumption.",
    )
    show.add_argument("machine", metavar="FILE_OR_NAME", help="machine file, or name of a built-in machine")
    add_json_argument(show)


def run(args: argparse.Namespace) -> int:
    """Run the action.

    Returns:
        The exit code.

    Raises:
        MachineError: the machine file is bad, or there is no built-in machine of that name.
        ArgumentError: the file to write exists.
        OSError: a file cannot be read or written.
    """
    actions = {"init": _init, "import": _import, "show": _show}
    return actions[args.action](args)


def _init(args: argparse.Namespace) -> int:
    from shapegcode.machine import Machine

    text = Machine.builtin_text(args.name)
    if args.output == "-":
        sys.stdout.write(text)
        return 0
    _write(args, text)
    print(f"wrote {args.output}, the values of {args.name}")
    print(f"next: put in your machine's limits and vibration modes, then: shapegcode machine show {args.output}")
    return 0


def _import(args: argparse.Namespace) -> int:
    from shapegcode.cli import runner
    from shapegcode.machine import Machine
    from shapegcode.machine.fanuc_import import import_parameters

    runner.check_files(args)
    found = import_parameters(args.dump, Machine.load(args.base) if args.base else None)
    _write(args, found.to_toml())
    return runner.finish(found, args, wrote=[args.output])


def _show(args: argparse.Namespace) -> int:
    from shapegcode.cli import runner
    from shapegcode.machine.result import describe_machine

    runner.check_files(args)
    return runner.finish(describe_machine(args.machine), args)


def _write(args: argparse.Namespace, text: str) -> None:
    """Write the machine file of ``-o``.

    Raises:
        ArgumentError: it exists, and nobody said ``--force``.
    """
    from shapegcode.errors import ArgumentError
    from shapegcode.io.atomic import write_text

    try:
        write_text(args.output, text, overwrite=args.force)
    except FileExistsError:
        said = f"{args.output} exists; --force overwrites it, -o FILE writes another one"
        raise ArgumentError(said) from None
