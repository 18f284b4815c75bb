"""Arguments that several commands share: program, machine with `--set` and options for its keys, pictures, files."""

from __future__ import annotations

import argparse
import sys
import tomllib
from collections.abc import Iterable, Mapping
from pathlib import Path
from types import UnionType
from typing import TYPE_CHECKING, Annotated, Any, Literal, get_args, get_origin

from shapegcode.cli.arguments import NEEDED, OneOf, Row, axes, micrometres, number, program_choice, seconds, share
from shapegcode.errors import ArgumentError, MachineError, Problem
from shapegcode.io.data_file import toml_value, write_text

if TYPE_CHECKING:
    from shapegcode.batching.process import Cluster
    from shapegcode.machine import Machine


_MACHINE_HELP = "machine file (TOML), or name of a built-in machine such as vx500"
_SET: Row = (
    "--set", "KEY=VALUE", [None],
    "override one key of the machine file, for example --set input.arc_centre=absolute; may be repeated",
    [],
)  # fmt: skip
MACHINE = (("-m --machine", "MACHINE", None, _MACHINE_HELP, NEEDED), _SET)
MACHINE_OR_NONE = (("-m --machine", "MACHINE", None, _MACHINE_HELP), _SET)
PROGRAM = (
    "--program", "O1234", program_choice,
    "program of a multi-program file (default: the first): O1234; /FOLDER/O1234 if several folders have it; <NAME>; "
    "#3: the third; all: every program that no other program calls",
)  # fmt: skip
"""``all`` is handled in `shapegcode.cli.several`."""

JSON = ("--json", "FILE", None, "write the result as JSON to FILE; -: to standard output, without other output")
SCRIPT = (
    "--html-script", None, ("inline", "beside"),
    "script of the page: inside it (default), or in a file that the pages of the folder share", "inline",
)  # fmt: skip
QUIET = ("-q --quiet", None, bool, "only the answer, warnings and errors")
AMOUNT = OneOf("verbosity", (
    QUIET, ("-v --verbose", None, bool, "every table with every column and row, however wide"),
))  # fmt: skip
_PAGE = ("--html", "FILE", None, "write the result as a page: one HTML file, readable offline")
_CITE = ("--cite", None, bool, "also list the papers on which the methods are based, as BibTeX")
RESULT = (JSON, _PAGE, SCRIPT, _CITE, AMOUNT)  # of every command with a result
RESULT_OF_DRAWS = (JSON, _PAGE, SCRIPT, AMOUNT)  # without --cite: the methods are those of `convert`


def program_input(metavar: str = "IN") -> tuple[Row, ...]:
    """The program, ``-m MACHINE`` with ``--set``, and ``--program O1234``."""
    return ("input", metavar, None, "CNC program"), *MACHINE, PROGRAM


def plots(what: str = "write pictures (PNG and SVG) into this folder: cut that vibrates most, tolerance curve") -> Row:
    """``--plots DIR`` with the help *what*."""
    return "--plots", "DIR", None, what


def cluster(what: str) -> tuple[Row, ...]:
    """``--scheduler`` and its certificates; *what*: the work that runs there."""
    certificates = {"ca": "the authority's certificate", "cert": "own certificate", "key": "own key"}
    return (
        ("--scheduler", "ADDRESS", None,
         f"{what} on Dask: tcp://host:port or tls://host:port; local: a cluster on this machine"),
        *((f"--tls-{name}", "FILE", None, f"{of}, for tls:// schedulers", "") for name, of in certificates.items()),
    )  # fmt: skip


def cluster_of(args: argparse.Namespace) -> Cluster | None:
    """Cluster given by the options of `cluster`; None without them."""
    from shapegcode.batching.process import Cluster

    return None if args.scheduler is None else Cluster(args.scheduler, args.tls_ca, args.tls_cert, args.tls_key)


MODES = (
    ("--keep-modes", "AXES", axes,
     "keep the modes of these axes without a test, for example XY; do so only if the file was made for this machine"),
    ("--rigid", "AXES", axes, "these axes have no significant vibration mode, for example Z"),
)  # fmt: skip
"""Options for modes that were not measured on this machine."""


def cutting(*, required: bool) -> tuple[Row, ...]:
    """Options of a feed schedule: tool, stock, margin, resolution."""
    return (
        ("--tool", "T.toml", {"action": "append", "required": required},
         "tool file: end mill, cutting force, limits (docs/reference/tool_files.md); may be repeated if each file "
         "has a T number"),
        ("--stock", "S.toml", {"required": required},
         "stock file: shape of the workpiece before the first block (docs/reference/tool_files.md)"),
        ("--margin", "RATIO", share,
         "margin of scheduled feeds to limits of force, deflection, torque and power (default: 1.5%%)"),
        ("--resolution", "LENGTH", micrometres,
         "grid spacing of the simulated material, for example 50um (default: 1 %% of the smallest tool's diameter)"),
    )  # fmt: skip


def read_cutting(args: argparse.Namespace) -> dict[str, Any]:
    """Arguments of `schedule_feed` and `convert_scheduled` from the options of `cutting`."""
    from shapegcode.cutting.stock import Stock
    from shapegcode.cutting.tool import Tool
    from shapegcode.feed.schedule import MARGIN

    return {
        "tools": [Tool.load(name) for name in args.tool],
        "stock": Stock.load(args.stock),
        "margin": MARGIN if args.margin is None else args.margin,
        "resolution_mm": None if args.resolution is None else args.resolution * 1e-3,
    }


def load_machine(args: argparse.Namespace, *, writes_program: bool = False) -> Machine:
    """The machine of ``-m`` with the values of ``--set``; with *writes_program* its output dialect must be FANUC."""
    from shapegcode.machine import Machine

    machine = Machine.load(args.machine)
    if machine.origin_warning:
        print(f"warning: {args.machine}: {machine.origin_warning}".replace("FILE", args.machine), file=sys.stderr)
    values = {}
    for assignment in args.set:
        key, sign, text = assignment.partition("=")
        if not sign:
            raise MachineError("--set", (Problem(assignment, "", "must be KEY=VALUE"),))
        values[key.strip()] = _toml_value(text)
    machine = machine.with_values(values, source=f"{args.machine} with --set") if values else machine
    if writes_program and (dialect := machine.emission.dialect) != "fanuc":
        raise ArgumentError(
            f"this command writes for FANUC only, and emission.dialect is {dialect}: G04 P and other words may have "
            "another meaning there; --set emission.dialect=fanuc writes them nevertheless"
        )
    return machine


def _toml_value(text: str) -> Any:
    # A bare word is a string: quotes would have to be escaped from the shell.
    try:
        return toml_value(text)
    except tomllib.TOMLDecodeError:
        return text
    except ValueError as error:
        raise MachineError("--set", (Problem("", "", str(error)),)) from None


def output_file(name: str) -> Path:
    """The file of ``-o``."""
    if name == "-":
        raise ArgumentError("-o - : the program needs a file of its own; --json - writes the report to standard output")
    path = Path(name)
    if not path.name or path.is_dir():
        raise ArgumentError(f"-o {name}: the output must be a file, not a folder")
    return path


def file_exists(name: str) -> ArgumentError:
    """The error for an existing file without --force."""
    return ArgumentError(f"{name} exists; --force overwrites it, -o FILE writes another one")


def write_new(args: argparse.Namespace, text: str) -> None:
    """Write the file of ``-o``; replace an existing one only with ``--force``."""
    try:
        write_text(args.output, text, overwrite=args.force)
    except FileExistsError:
        raise file_exists(args.output) from None


def refuse_same_file(targets: Iterable[Path], others: Iterable[Path]) -> None:
    """Refuse to write a file that the same run also reads, or writes twice."""
    targets, others = list(targets), list(others)
    for rank, target in enumerate(targets, start=1):
        for other in [*others, *targets[rank:]]:
            same = target.exists() and other.exists() and target.samefile(other)
            if same or target.absolute() == other.absolute():
                raise ArgumentError(
                    f"{target} would overwrite {other}, which this run reads or writes too: name another file"
                )


# Values with a unit on the command line: metavar, parser, example.
_TYPED: dict[str, dict[str, Any]] = {
    "µm": {"metavar": "LENGTH", "type": micrometres, "example": "5um"},
    "s": {"metavar": "TIME", "type": seconds, "example": "5ms"},
    "%": {"metavar": "PERCENT", "type": lambda text: number(text.removesuffix("%")), "example": "10%"},
}
_MAX_CHOICES_SHOWN = 4


def override_options(keys: Mapping[str, str]) -> tuple[Row, ...]:
    """One option per key, without a default: the machine's value applies."""
    rows = []
    for option, key in keys.items():
        meaning, unit, kind = _facts(key)
        if kind is bool:
            settings: dict[str, Any] = {"action": argparse.BooleanOptionalAction}
        elif get_origin(kind) is Literal:
            settings = {"choices": get_args(kind)}
            if len(settings["choices"]) > _MAX_CHOICES_SHOWN:
                settings["metavar"] = key.rpartition(".")[2].upper()
                meaning += f". One of {', '.join(settings['choices'])}"
        elif unit in _TYPED:
            settings = {name: _TYPED[unit][name] for name in ("metavar", "type")}
            meaning += f"; for example {_TYPED[unit]['example']}"
        else:
            settings = {"metavar": unit.upper() or "N", "type": number}
        rows.append((option, None, settings, f"{meaning} (default: {key} of the machine file)".replace("%", "%%")))
    return tuple(rows)


def overridden(machine: Machine, args: argparse.Namespace, keys: Mapping[str, str]) -> Machine:
    """The machine with the values of these options."""
    typed = {key: getattr(args, option.removeprefix("--").replace("-", "_")) for option, key in keys.items()}
    stated = {key: value for key, value in typed.items() if value is not None}
    return machine.with_values(stated, source="options") if stated else machine


def _facts(key: str) -> tuple[str, str, Any]:
    """Meaning, unit and type of a key of the machine file."""
    from shapegcode.machine import Machine
    from shapegcode.settings.keys import facts
    from shapegcode.settings.load import field_of

    field = field_of(Machine, key.split("."))
    assert field is not None
    kind: Any = field.annotation
    while isinstance(kind, UnionType) or get_origin(kind) is Annotated:
        kind = get_args(kind)[0]
    return field.description or "", facts(field).get("unit", ""), kind


def decided_modes(args: argparse.Namespace, open_modes: Mapping[str, str], introduction: str) -> tuple[str, str]:
    """Axes whose modes are kept and rigid axes, by the options; at a terminal the user is asked for others."""
    keep, rigid = args.keep_modes or "", args.rigid or ""
    if not (sys.stdin.isatty() and sys.stderr.isatty()):
        return keep, rigid
    for axis, modes in open_modes.items():
        if axis in keep or axis in rigid:
            continue
        question = f"{introduction} {axis.upper()} has {modes}: [k]eep, [r]igid, or leave [o]pen? "
        print(question, end="", file=sys.stderr, flush=True)
        answer = sys.stdin.readline().strip().lower()[:1]
        keep += axis if answer == "k" else ""
        rigid += axis if answer == "r" else ""
    return keep, rigid
