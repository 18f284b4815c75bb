"""Arguments that several commands share: the program, the machine with `--set`, pictures, files."""

from __future__ import annotations

import argparse
from collections.abc import Iterable
from pathlib import Path
from typing import TYPE_CHECKING, Any

from shapegcode.cli.arguments import one_of
from shapegcode.cli.console import add_json_argument
from shapegcode.cli.typed import program_choice

if TYPE_CHECKING:
    from shapegcode.machine import Machine


def add_input_arguments(parser: argparse.ArgumentParser, metavar: str = "IN") -> None:
    """Declare what a command reads: the program, ``-m MACHINE`` with ``--set``, and ``--program O1234``."""
    parser.add_argument("input", metavar=metavar, help="CNC program")
    add_machine_argument(parser)
    add_program_argument(parser)


def add_machine_argument(parser: argparse.ArgumentParser, *, required: bool = True) -> None:
    """Declare ``-m MACHINE`` and ``--set KEY=VALUE``."""
    parser.add_argument(
        "-m",
        "--machine",
        metavar="MACHINE",
        required=required,
        help="machine file (TOML), or name of a built-in machine such as vx500",
    )
    parser.add_argument(
        "--set",
        metavar="KEY=VALUE",
        action="append",
        default=[],
        help="use another value for one key of the machine file, for example "
        "--set input.arc_centre=absolute; may be repeated",
    )


def add_plots_argument(
    parser: argparse.ArgumentParser,
    what: str = "write pictures (PNG and SVG) of the region that vibrates most into this folder",
) -> None:
    """Declare ``--plots DIR``; *what* is its help."""
    parser.add_argument("--plots", metavar="DIR", default=None, help=what)


def add_result_arguments(parser: argparse.ArgumentParser) -> None:
    """Declare ``--json``, ``--html``, ``--html-script``, ``--quiet``, ``--verbose``: of every command with a result."""
    add_json_argument(parser)
    parser.add_argument(
        "--html",
        metavar="FILE",
        default=None,
        help="write the result as a page: one file that any browser opens, without a network",
    )
    add_script_argument(parser)
    add_amount_arguments(parser)


def add_amount_arguments(parser: argparse.ArgumentParser) -> None:
    """Declare ``--quiet`` and ``--verbose``."""
    amount = one_of(parser, "how much is said")
    amount.add_argument("-q", "--quiet", action="store_true", help="only the answer, warnings and errors")
    amount.add_argument(
        "-v", "--verbose", action="store_true", help="every table with every column and row, however wide"
    )


def add_script_argument(parser: argparse.ArgumentParser) -> None:
    """Declare ``--html-script``."""
    parser.add_argument(
        "--html-script",
        choices=("inline", "beside"),
        default="inline",
        help="the page's script in its file (default), or in one beside it, which other pages share",
    )


def add_program_argument(parser: argparse.ArgumentParser) -> None:
    """Declare ``--program O1234``; ``all`` is taken up by `shapegcode.cli.several`."""
    parser.add_argument(
        "--program",
        metavar="O1234",
        type=program_choice,
        default=None,
        help="program to read of a file that holds several (default: the first): its number, /FOLDER/O1234 where "
        "folders of a memory punch hold the same one, <NAME>, #3 for the third one; all: each that no other one calls",
    )


def load_machine(args: argparse.Namespace) -> Machine:
    """The machine of ``-m`` with the values of ``--set``."""
    from shapegcode.errors import MachineError, Problem
    from shapegcode.machine import Machine

    machine = Machine.load(args.machine)
    values = {}
    for assignment in args.set:
        key, sign, text = assignment.partition("=")
        if not sign:
            raise MachineError("--set", (Problem(assignment, "", "must be KEY=VALUE"),))
        values[key.strip()] = _toml_value(text)
    return machine.with_values(values, source=f"{args.machine} with --set") if values else machine


def _toml_value(text: str) -> Any:
    # A bare word is a string: quotes would have to be escaped from the shell.
    import tomllib

    from shapegcode.errors import MachineError, Problem
    from shapegcode.io.data_file import toml_tables

    try:
        return toml_tables(f"value = {text}")["value"]
    except tomllib.TOMLDecodeError:
        return text
    except ValueError as error:
        raise MachineError("--set", (Problem("", "", str(error)),)) from None


def output_file(name: str) -> Path:
    """The file of ``-o``."""
    from shapegcode._core import ArgumentError

    if name == "-":
        raise ArgumentError("-o - : the program needs a file of its own; --json - writes the report to standard output")
    path = Path(name)
    if not path.name or path.is_dir():
        raise ArgumentError(f"-o {name}: the output must be a file, not a folder")
    return path


def refuse_same_file(targets: Iterable[Path], others: Iterable[Path]) -> None:
    """Refuse to write a file that is read, or written otherwise, in the same run."""
    from shapegcode._core import ArgumentError

    others = list(others)
    for target in targets:
        for other in others:
            same = target.exists() and other.exists() and target.samefile(other)
            if same or target.absolute() == other.absolute():
                raise ArgumentError(
                    f"{target} would overwrite {other}, which this run reads or writes too: name another file"
                )
