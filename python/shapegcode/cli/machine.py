"""``shapegcode machine``: write a first machine file, import one, or explain its values; ``setup``: make
one by answering questions."""

from __future__ import annotations

import argparse
import sys
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING

from shapegcode.cli import runner
from shapegcode.cli.arguments import Interface
from shapegcode.cli.options import MODES, QUIET, RESULT, decided_modes, file_exists, write_new
from shapegcode.errors import ArgumentError
from shapegcode.io.data_file import read_file, write_text

if TYPE_CHECKING:
    from shapegcode.machine import Machine
    from shapegcode.machine.result import MachineDescription
    from shapegcode.settings.keys import TomlTable

FILES = ("machine", "tool", "stock", "study")  # kinds of TOML files that have a schema

_DEFAULT_FILE = "machine.toml"


def _init(args: argparse.Namespace) -> int:
    from shapegcode.machine import Machine, inherited_text

    text = inherited_text(args.name)
    if not args.full:
        text = Machine.from_toml(text, args.name).to_toml(short=True)
    if args.output == "-":
        sys.stdout.write(text)
        return 0
    write_new(args, text)
    print(f"wrote {args.output}, the values of {args.name}: inherited or assumed, until you enter your own")
    if not args.quiet:
        print(f"next: enter your machine's limits and vibration modes, then: shapegcode machine show {args.output}")
    return 0


def _import(args: argparse.Namespace) -> int:
    from shapegcode.machine import Machine
    from shapegcode.machine.control_import import import_parameters

    runner.check_files(args)
    dump, tables = _sorted(args.dump)
    base = Machine.load(args.base) if args.base else None
    keep, rigid = decided_modes(args, _modes_of(base), "a dump contains no modes, and")
    found = import_parameters(dump, base, tables=tables, name=args.name, keep_modes=keep, rigid=rigid)
    if found.ok:
        write_new(args, found.to_toml())
    wrote = [args.output] if found.ok else []
    return runner.finish(found, args, tables=found.tables(everything=args.verbose), wrote=wrote)


def _modes_of(machine: Machine | None) -> dict[str, str]:
    """Modes of a machine per axis, as text."""
    if machine is None:
        return {}
    axes = zip("xyz", machine.axes.as_tuple(), strict=True)
    frequencies = {name: [f"{mode.frequency_hz:g} Hz" for mode in axis.modes] for name, axis in axes}
    return {name: f"{', '.join(found)} (of {machine.name})" for name, found in frequencies.items() if found}


def _sorted(files: list[str]) -> tuple[str, list[str]]:
    """Split files into the parameter dump and the tables."""
    from shapegcode.machine.fanuc_dump import is_table

    if len(files) == 1:
        return files[0], []
    tables = [file for file in files if is_table(read_file(file))]
    dumps = [file for file in files if file not in tables]
    if len(dumps) != 1:
        note = f"more than one: {', '.join(dumps)}" if dumps else "none: tables of offsets do not make a machine"
        raise ArgumentError(f"one parameter dump (CNC-PARA.TXT) is needed; found: {note}")
    return dumps[0], tables


def _show(args: argparse.Namespace) -> int:
    from shapegcode.machine.result import describe_machine

    runner.check_files(args)
    if args.write_origins:
        _write_origins(args.machine)
    found = replace(describe_machine(args.machine), source=args.machine)
    if args.input is not None:
        found = _ranked(found, args)
    wrote = [args.machine] if args.write_origins else []
    return runner.finish(found, args, tables=found.tables(everything=args.verbose), wrote=wrote)


def _write_origins(name: str) -> None:
    """Write the provenance of the values of a machine file into it as a table; leave everything else unchanged."""
    from shapegcode.identification.update import check_updatable
    from shapegcode.machine import Machine
    from shapegcode.settings.edit import with_origin_table

    check_updatable(name)
    text = Path(name).read_bytes().decode("utf-8")
    mark = "\ufeff" if text.startswith("\ufeff") else ""
    new = with_origin_table(text.removeprefix(mark))
    Machine.from_toml(new, name)
    write_text(name, mark + new)


def _ranked(found: MachineDescription, args: argparse.Namespace) -> MachineDescription:
    """Add the unverified values, ranked by their effect on a program."""
    from shapegcode.conversion.convert import convert
    from shapegcode.conversion.tables import rank_unknown_axes
    from shapegcode.machine import Machine
    from shapegcode.machine.programs import ANY_PRICE
    from shapegcode.machine.result import OpenValue

    machine, note = Machine.load(args.machine), ""
    with runner.progress(f"converting {args.input}", args):
        if any(axis.modes for axis in machine.axes.as_tuple()):
            # The ranking is for the shaped program, even if shaping is not worth its price.
            conversion = convert(args.input, machine.with_values(ANY_PRICE), shape_all=True, tolerance_curve=False)
            rows = conversion.parameter_sensitivity
            if conversion.worst_case is None:
                note = f"{args.input}: nothing was shaped, so nothing is ranked"
        else:
            rows = rank_unknown_axes(args.input, machine)
            note = (
                "no axis has a vibration mode, so there is nothing to shape for: each that may have one was given a "
                "usual one, and the unchanged program was simulated"
                if rows
                else "every axis is declared rigid, so there is nothing to shape for"
            )
    matters = []
    for row in rows:
        does = f"{row.figure} {row.figure_um:.1f} → {row.tested_um:.1f}, limit {row.limit_um:.1f} µm"
        matters.append(OpenValue(row.key, row.value, row.origin, row.tested_value, does, row.share))
    warnings = (*found.warnings, note) if note else found.warnings
    return replace(found, program=args.input, matters=tuple(matters), warnings=warnings)


def _diff(args: argparse.Namespace) -> int:
    from shapegcode.machine.result import machine_difference

    runner.check_files(args)
    return runner.finish(machine_difference(*args.files), args)


def file_schema(kind: str) -> str:
    """JSON Schema of a TOML file, as text."""
    from shapegcode.cutting.stock import Stock
    from shapegcode.cutting.tool import Tool
    from shapegcode.machine import Machine
    from shapegcode.results.json import to_text
    from shapegcode.settings.describe import toml_schema
    from shapegcode.studies.study_file import study_schema

    title = f"{kind} file of shapegcode"
    if kind == "study":
        return to_text(study_schema(title))
    models: dict[str, type[TomlTable]] = {"machine": Machine, "tool": Tool, "stock": Stock}
    return to_text(toml_schema(models[kind], title, origins=kind == "machine"))


def _schema(args: argparse.Namespace) -> int:
    if args.output == "-":
        sys.stdout.write(file_schema(args.kind))
    else:
        write_text(args.output, file_schema(args.kind))
        print(f"wrote {args.output}")
        if not args.quiet:
            print(f"next: write `#:schema {args.output}` into the first line of a {args.kind} file")
    return 0


_FORCE = ("--force", None, bool, "overwrite an existing file")

_INIT_ACTION = Interface(
    "",
    (
        ("name", "NAME", {"nargs": "?"}, "built-in machine to start from (default: %(default)s)", "vx500"),
        ("-o --output", "FILE", None, "file to write (default: %(default)s); - for standard output", _DEFAULT_FILE),
        ("--full", None, bool, "every key with its meaning, not only values that differ from a default"),
        _FORCE,
        QUIET,
    ),
    _init,
)
_IMPORT_ACTION = Interface(
    "Make a machine file from a FANUC parameter dump, and list what was read, assumed and missing. "
    "Exit code 0: done; 1: nothing was read, no file is written; 2: bad input.",
    (
        ("dump", "DUMP", {"nargs": "+"},
         "parameter dump as punched by the control; optionally also its tables of tool offsets, work offsets "
         "and variables (TOOLOFST.TXT, EXT_WKZ.TXT, MACRO.TXT)"),
        ("-o --output", "FILE", None, "file to write (default: %(default)s)", _DEFAULT_FILE),
        ("--from", "MACHINE", {"dest": "base"}, "machine for values that are not in the dump, such as the modes"),
        *MODES,
        ("--name", "NAME", None, "name of the machine (default: name of the dump file)"),
        _FORCE,
        *RESULT,
    ),
    _import,
)  # fmt: skip
_SHOW_ACTION = Interface(
    "Print every value with its unit, meaning and origin: measured, from the parameter dump, inherited "
    "from another machine, assumed, a choice, set in the file, or a default.",
    (
        ("machine", "FILE_OR_NAME", None, "machine file, or name of a built-in machine"),
        ("--for", "PROGRAM", {"dest": "input"},
         "convert this program, and rank the unverified parameters by their effect on its verdict"),
        ("--write-origins", None, bool,
         "write the origins that the file gives in comments or next to its values into a table [origin] of the "
         "file"),
        *RESULT,
    ),
    _show,
)  # fmt: skip
_DIFF_ACTION = Interface(
    "List the values in which two machines differ, defaults included; origins are not compared. "
    "Exit code 0: no difference; 1: some; 2: bad input.",
    (("files", "MACHINE", {"nargs": 2}, "machine file, or name of a built-in machine"), *RESULT),
    _diff,
)
_SCHEMA_ACTION = Interface(
    "Print the JSON Schema of a TOML file. Editors with TOML support (taplo, Even Better TOML) "
    "complete and check a file that begins with `#:schema machine.schema.json`.",
    (
        ("kind", None, {"choices": FILES, "nargs": "?"}, "kind of file", "machine"),
        ("-o --output", "FILE", None, "file to write (default: standard output)", "-"),
        QUIET,
    ),
    _schema,
)

MACHINE = Interface(
    "Writes or explains a machine file, or imports one. Exit code 0: done; 1: nothing read, or values differ; "
    "2: bad input.",
    actions={
        "init": ("write a commented machine file as a start", _INIT_ACTION),
        "import": ("make a machine file from a control's parameter dump (CNC-PARA.TXT)", _IMPORT_ACTION),
        "show": ("print every value with its unit, origin and meaning", _SHOW_ACTION),
        "diff": ("list the values in which two machines differ", _DIFF_ACTION),
        "schema": ("print the JSON Schema of machine, tool, stock or study files, for editors", _SCHEMA_ACTION),
    },
)


def _set_up(args: argparse.Namespace) -> int:
    from shapegcode.setup.answers import read_answers
    from shapegcode.setup.build import set_up

    runner.check_files(args, also_read=[args.answers] if args.answers else [])
    if Path(args.output).exists() and not args.force:
        raise file_exists(args.output)  # before the questions are answered
    if args.answers is not None:
        answers = read_answers(args.answers)
    elif sys.stdin.isatty() and sys.stdout.isatty():
        from shapegcode.setup.ask import ask_all  # imports the dialogue modules

        answers = ask_all()
    else:
        raise ArgumentError("setup needs a terminal for its questions; without one use --answers FILE")
    found = set_up(answers)
    write_new(args, found.text)
    return runner.finish(replace(found, file=args.output), args, notes=found.notes, wrote=[args.output])


SETUP = Interface(
    "Asks for the data of your machine, explains what each answer changes, reads the control's parameter "
    "file and tap tests if there are any, and writes a short machine file with the answers and their provenance; "
    "everything else is a default. At every question Enter means `not known yet`, and < goes back to the previous "
    "question. Another machine's modes are never used.",
    (
        ("-o --output", "FILE", None, "machine file to write (default: %(default)s)", _DEFAULT_FILE),
        ("--answers", "FILE", None,
         "answers from a file (TOML or JSON) instead of questions; the keys are in docs/howto/setup.md"),
        _FORCE,
        *RESULT,
    ),
    _set_up,
)  # fmt: skip
