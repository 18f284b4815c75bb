"""Arguments that several commands share: program, machine with `--set` and options for its keys, pictures, files."""

from __future__ import annotations

import argparse
import sys
from collections.abc import Iterable, Mapping
from pathlib import Path
from types import UnionType
from typing import TYPE_CHECKING, Annotated, Any, Literal, get_args, get_origin

from shapegcode.cli.arguments import add_options, axes, micrometres, number, one_of, program_choice, seconds, share
from shapegcode.io.data_file import write_text

if TYPE_CHECKING:
    from shapegcode.batching.process import Cluster
    from shapegcode.machine import Machine


def add_input_arguments(parser: argparse.ArgumentParser, metavar: str = "IN") -> None:
    """Declare what a command reads: the program, ``-m MACHINE`` with ``--set``, and ``--program O1234``."""
    parser.add_argument("input", metavar=metavar, help="CNC program")
    add_machine_argument(parser)
    add_program_argument(parser)


def add_machine_argument(parser: argparse.ArgumentParser, *, required: bool = True) -> None:
    """Declare ``-m MACHINE`` and ``--set KEY=VALUE``."""
    add_options(parser, (
        ("-m --machine", "MACHINE", {"required": required},
         "machine file (TOML), or name of a built-in machine such as vx500"),
        ("--set", "KEY=VALUE", [None],
         "use another value for one key of the machine file, for example --set input.arc_centre=absolute; may be "
         "repeated", []),
    ))  # fmt: skip


def add_plots_argument(
    parser: argparse.ArgumentParser,
    what: str = "write pictures (PNG and SVG) of the region that vibrates most into this folder",
) -> None:
    """Declare ``--plots DIR``; *what* is its help."""
    parser.add_argument("--plots", metavar="DIR", help=what)


def add_result_arguments(parser: argparse.ArgumentParser, *, cites: bool = True) -> None:
    """Declare what every command with a result has; *cites*: with ``--cite``."""
    add_json_argument(parser)
    page = "write the result as a page: one file that any browser opens, without a network"
    parser.add_argument("--html", metavar="FILE", help=page)
    add_script_argument(parser)
    if cites:
        papers = "also say which papers are behind the methods of this run, as BibTeX"
        parser.add_argument("--cite", action="store_true", help=papers)
    add_amount_arguments(parser)


def add_json_argument(parser: argparse.ArgumentParser) -> None:
    """Declare ``--json FILE``; the value is ``args.json``, None where it is not given."""
    parser.add_argument(
        "--json", metavar="FILE", help="write the result as JSON to FILE; - for standard output and nothing else there"
    )


def add_amount_arguments(parser: argparse.ArgumentParser) -> None:
    """Declare ``--quiet`` and ``--verbose``."""
    add_options(one_of(parser, "verbosity"), (
        ("-q --quiet", None, bool, "only the answer, warnings and errors"),
        ("-v --verbose", None, bool, "every table with every column and row, however wide"),
    ))  # fmt: skip


def add_cluster_arguments(parser: argparse.ArgumentParser, what: str) -> None:
    """Declare ``--scheduler`` and its certificates; `what` names the work that runs there."""
    where = f"{what} on Dask: tcp://host:port or tls://host:port; local: a cluster on this machine"
    parser.add_argument("--scheduler", metavar="ADDRESS", help=where)
    for name, of in (("ca", "the authority's certificate"), ("cert", "own certificate"), ("key", "own key")):
        parser.add_argument(f"--tls-{name}", metavar="FILE", default="", help=f"{of}, for tls:// schedulers")


def cluster_of(args: argparse.Namespace) -> Cluster | None:
    """What `add_cluster_arguments` declared."""
    from shapegcode.batching.process import Cluster

    return None if args.scheduler is None else Cluster(args.scheduler, args.tls_ca, args.tls_cert, args.tls_key)


def add_script_argument(parser: argparse.ArgumentParser) -> None:
    """Declare ``--html-script``."""
    where = "the page's script in its file (default), or in one beside it, which other pages share"
    parser.add_argument("--html-script", choices=("inline", "beside"), default="inline", help=where)


def add_program_argument(parser: argparse.ArgumentParser) -> None:
    """Declare ``--program O1234``; ``all`` is taken up by `shapegcode.cli.several`."""
    parser.add_argument(
        "--program",
        metavar="O1234",
        type=program_choice,
        help="program to read of a file that holds several (default: the first): its number, /FOLDER/O1234 where "
        "folders of a memory punch hold the same one, <NAME>, #3 for the third one; all: each that no other one calls",
    )


def load_machine(args: argparse.Namespace, *, writes_program: bool = False) -> Machine:
    """The machine of ``-m`` with the values of ``--set``; refused where a program cannot be written in its words."""
    from shapegcode.errors import ArgumentError, MachineError, Problem
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


def file_exists(name: str) -> Exception:
    """The error for an existing file without --force."""
    from shapegcode.errors import ArgumentError

    return ArgumentError(f"{name} exists; --force overwrites it, -o FILE writes another one")


def write_new(args: argparse.Namespace, text: str) -> None:
    """Write the file of ``-o``; an existing file is replaced only with ``--force``."""
    try:
        write_text(args.output, text, overwrite=args.force)
    except FileExistsError:
        raise file_exists(args.output) from None


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


# How a value of a unit is typed on the command line: what is shown for it, what reads it, an example.
_TYPED = {
    "µm": ("LENGTH", micrometres, "5um"),
    "s": ("TIME", seconds, "5ms"),
    "%": ("PERCENT", lambda text: number(text.removesuffix("%")), "10%"),
}
_MAX_CHOICES_SHOWN = 4


def add_override_arguments(parser: argparse.ArgumentParser, keys: Mapping[str, str]) -> None:
    """Declare an option for each key, without a default: what is not typed is the machine's own."""
    for option, key in keys.items():
        meaning, unit, kind = _facts(key)
        settings: dict[str, Any] = {"default": None}
        if kind is bool:
            settings["action"] = argparse.BooleanOptionalAction
        elif get_origin(kind) is Literal:
            settings["choices"] = get_args(kind)
            if len(settings["choices"]) > _MAX_CHOICES_SHOWN:
                settings["metavar"] = key.rpartition(".")[2].upper()
                meaning += f". One of {', '.join(settings['choices'])}"
        elif unit in _TYPED:
            settings["metavar"], settings["type"], example = _TYPED[unit]
            meaning += f"; for example {example}"
        else:
            settings["metavar"], settings["type"] = unit.upper() or "N", number
        text = f"{meaning} (default: {key} of the machine file)".replace("%", "%%")
        parser.add_argument(option, help=text, **settings)


def overridden(machine: Machine, args: argparse.Namespace, keys: Mapping[str, str]) -> Machine:
    """The machine with the values that were typed."""
    typed = {key: getattr(args, option.removeprefix("--").replace("-", "_")) for option, key in keys.items()}
    stated = {key: value for key, value in typed.items() if value is not None}
    return machine.with_values(stated, source="options") if stated else machine


def _facts(key: str) -> tuple[str, str, Any]:
    """Meaning, unit and type of a key of the machine file."""
    from shapegcode.machine import Machine
    from shapegcode.settings.keys import facts, table_type

    table: Any = Machine
    *tables, last = key.split(".")
    for name in tables:
        table = table_type(table.model_fields[name])
    field = table.model_fields[last]
    kind = field.annotation
    if isinstance(kind, UnionType):
        kind = get_args(kind)[0]
    if get_origin(kind) is Annotated:
        kind = get_args(kind)[0]
    return field.description or "", facts(field).get("unit", ""), kind


def add_modes_arguments(parser: argparse.ArgumentParser, keep: str) -> None:
    """Declare what decides over modes that were not measured on this machine."""
    add_options(parser, (
        (keep, "AXES", {"dest": "keep_modes", "type": axes},
         "keep the modes of these axes, for example XY, though they were not measured here: it is the same machine"),
        ("--rigid", "AXES", axes, "these axes have no vibration mode that counts, for example Z"),
    ))  # fmt: skip


def decided_modes(args: argparse.Namespace, open_modes: Mapping[str, str], introduction: str) -> tuple[str, str]:
    """What the options say, and at a terminal the answers to a question for each axis that they leave open."""
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


def add_cutting_arguments(parser: argparse.ArgumentParser, *, required: bool) -> None:
    """Declare what a feed schedule needs beside program and machine: tool, stock, margin, resolution."""
    add_options(parser, (
        ("--tool", "T.toml", {"action": "append", "required": required},
         "tool file: end mill, cutting force, limits (docs/reference/tool_files.md); repeated, each file needs its T "
         "number"),
        ("--stock", "S.toml", {"required": required},
         "stock file: shape of the workpiece before the first block (docs/reference/tool_files.md)"),
        ("--margin", "RATIO", share, "share of each limit that is left free, for example 3%% (default: 1.5%%)"),
        ("--resolution", "LENGTH", micrometres,
         "grid of the material, for example 50um (default: a hundredth of the tool's diameter)"),
    ))  # fmt: skip


def read_cutting_arguments(args: argparse.Namespace) -> dict[str, Any]:
    """What `add_cutting_arguments` declared, as `schedule_feed` and `convert_scheduled` take it."""
    from shapegcode.cutting.stock import Stock
    from shapegcode.cutting.tool import Tool
    from shapegcode.feed.schedule import MARGIN

    return {
        "tools": [Tool.load(name) for name in args.tool],
        "stock": Stock.load(args.stock),
        "margin": MARGIN if args.margin is None else args.margin,
        "resolution_mm": None if args.resolution is None else args.resolution * 1e-3,
    }
