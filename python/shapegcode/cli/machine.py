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

    Raises:
        MachineError: the machine file is bad, or there is no built-in machine of that name.
        OSError: a file cannot be read or written.
    """
    actions = {"init": _init, "import": _import, "show": _show}
    return actions[args.action](args)


def _import(args: argparse.Namespace) -> int:
    from rich.text import Text

    from shapegcode.cli import ExitCode
    from shapegcode.cli.console import output_console, write_json
    from shapegcode.io.atomic import write_text
    from shapegcode.machine import Machine
    from shapegcode.machine.fanuc_import import read_parameters

    found = read_parameters(args.dump, Machine.load(args.base) if args.base else None)
    try:
        write_text(args.output, found.to_toml(), overwrite=args.force)
    except FileExistsError:
        print(f"shapegcode: {args.output} exists; --force overwrites it, -o FILE writes another one", file=sys.stderr)
        return ExitCode.BAD_INPUT
    if args.json is not None:
        write_json({"read": found.read, "assumed": found.assumed, "missing": found.missing}, args.json)
    console = output_console(args.json)
    console.print(f"read from {args.dump}:", markup=False)
    for row in found.read:
        where = f"line {row['line']}: {row['parameter']} {row['axis']}".rstrip()
        console.print(Text(f"  {where} = {row['raw']} -> {row['key']} = {row['value']}"))
    console.print("assumed:")
    for row in found.assumed:
        console.print(Text(f"  {row['key']} = {row['value']}: {row['why']}"))
    console.print("missing or not understood:")
    for row in found.missing:
        line = f"line {row['line']}: " if row["line"] else ""
        console.print(Text(f"  {line}{row['parameter']} {row['why']}".replace(":  ", ": ")))
    console.print(f"wrote {args.output}", markup=False)
    return ExitCode.OK


def _init(args: argparse.Namespace) -> int:
    from shapegcode.cli import ExitCode
    from shapegcode.io.atomic import write_text
    from shapegcode.machine import Machine

    text = Machine.builtin_text(args.name)
    if args.output == "-":
        sys.stdout.write(text)
        return ExitCode.OK
    try:
        write_text(args.output, text, overwrite=args.force)
    except FileExistsError:
        print(
            f"shapegcode: {args.output} exists; --force overwrites it, -o FILE writes another one",
            file=sys.stderr,
        )
        return ExitCode.BAD_INPUT
    print(f"wrote {args.output}, the values of {args.name}")
    print(f"next: put in your machine's limits and vibration modes, then: shapegcode machine show {args.output}")
    return ExitCode.OK


def _show(args: argparse.Namespace) -> int:
    from rich.box import SIMPLE_HEAD
    from rich.table import Table
    from rich.text import Text

    from shapegcode.cli import ExitCode
    from shapegcode.cli.console import output_console, write_json
    from shapegcode.machine import Machine

    machine = Machine.load(args.machine)
    values = machine.values()
    if args.json is not None:
        write_json(
            {
                "machine": machine.model_dump(mode="json"),
                "keys": {
                    value.info.key: {
                        "value": value.value,
                        "unit": value.info.unit,
                        "origin": value.origin,
                        "meaning": value.info.meaning,
                        "fanuc": value.info.fanuc,
                        "assumed": value.assumed,
                    }
                    for value in values
                },
            },
            args.json,
        )
    table = Table(
        title=Text(f"{machine.name}: {machine.description}".rstrip(": ")),
        title_justify="left",
        box=SIMPLE_HEAD,
        pad_edge=False,
    )
    for heading in ("key", "value", "unit", "origin", "meaning"):
        table.add_column(heading, overflow="fold", no_wrap=heading in ("unit", "origin"))
    section = ""
    for value in values:
        head, _, name = value.info.key.rpartition(".")
        if head != section:
            table.add_row()
            table.add_row(Text(f"[{head}]", style="bold"))
            section = head
        origin = "assumed" if value.assumed else value.origin
        cells = (name, value.value, value.info.unit, origin, value.info.meaning)
        table.add_row(*(Text(cell) for cell in cells))
    output_console(args.json).print(table)
    return ExitCode.OK
