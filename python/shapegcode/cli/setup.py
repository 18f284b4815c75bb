"""``shapegcode setup``: questions about a machine, and a short machine file of the answers."""

from __future__ import annotations

import argparse
import sys
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Any, get_args

from shapegcode.cli.options import add_result_arguments

if TYPE_CHECKING:
    from shapegcode.setup.answers import Answers

__all__ = ["add_arguments", "ask_all", "run"]

_NOBODY_KNOWS = "nobody knows yet"
_VIBRATION = {
    "tapped: I have the record of a tap test": "file",
    "from a data sheet or an earlier test: I know frequency and damping": "known",
    "taken as rigid: no vibration of it counts": "rigid",
    _NOBODY_KNOWS: "unknown",
}


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Declare the arguments."""
    parser.description = (
        "Asks what a shop knows of its machine, says what each answer changes, reads parameter file and tap tests "
        "where there are some, and writes a short machine file: what was answered, and why; everything else is a "
        "default. Another machine's modes are never taken."
    )
    parser.add_argument(
        "-o", "--output", metavar="FILE", default="machine.toml", help="machine file to write (default: %(default)s)"
    )
    parser.add_argument(
        "--answers",
        metavar="FILE",
        default=None,
        help="answers from a file (TOML, or JSON) in place of questions; the keys are in docs/howto/setup.md",
    )
    parser.add_argument("--force", action="store_true", help="overwrite an existing file")
    add_result_arguments(parser)


def run(args: argparse.Namespace) -> int:
    """Ask, and write the machine file.

    Raises:
        AnswersError, MachineError, ArgumentError: a bad answer; the machine file exists; no terminal to ask at.
        OSError: a file cannot be read or written.
    """
    from shapegcode.cli import runner
    from shapegcode.errors import ArgumentError
    from shapegcode.io.atomic import write_text
    from shapegcode.setup.answers import read_answers
    from shapegcode.setup.build import set_up

    exists = ArgumentError(f"{args.output} exists; --force overwrites it, -o FILE writes another one")
    runner.check_files(args, also_read=[args.answers] if args.answers else [])
    if Path(args.output).exists() and not args.force:
        raise exists  # before anybody has answered a dozen questions
    if args.answers is not None:
        answers = read_answers(args.answers)
    elif sys.stdin.isatty() and sys.stdout.isatty():
        answers = ask_all()
    else:
        raise ArgumentError("setup asks at a terminal, and there is none: --answers FILE answers in place of it")
    found = set_up(answers)
    try:
        write_text(args.output, found.text, overwrite=args.force)
    except FileExistsError:
        raise exists from None
    return runner.finish(replace(found, file=args.output), args, notes=found.notes, wrote=[args.output])


def ask_all() -> Answers:
    """Ask every question that the answers before it leave open.

    Returns:
        The answers.

    Raises:
        KeyboardInterrupt: the user gave up.
    """
    from shapegcode.setup.answers import EXPLAINED, Answers, read_answers

    given: dict[str, Any] = {}
    for name, field in Answers.model_fields.items():
        if name in _left_out(given):
            continue
        answer = _vibration() if name == "modes" else _asked(name, field.description or "", field.annotation, given)
        if answer is not None:
            given[name] = answer
        value = getattr(read_answers({"name": "m", "rapid_mm_per_min": 1.0} | _alone(name, given)), name)
        print(f"  {EXPLAINED[name](value)}")
    return read_answers(given)


def _alone(name: str, given: dict[str, Any]) -> dict[str, Any]:
    """An answer with what it needs beside it."""
    needed = {"delivery", "dnc_baud"} if name in ("delivery", "dnc_baud") else {name}
    found = {key: given[key] for key in needed if key in given}
    return found | ({"dnc_baud": 9600} if name == "delivery" and given.get(name) == "dnc" else {})


def _left_out(given: dict[str, Any]) -> Iterator[str]:
    """Questions that the answers so far make needless."""
    if given.get("control") == "other":
        yield "dump"
    if given.get("dump"):
        yield from ("rapid_mm_per_min", "max_feed_mm_per_min", "max_acceleration_mm_s2", "least_increment_mm")
    if given.get("delivery") != "dnc":
        yield "dnc_baud"
    if given.get("delivery") != "memory":
        yield "program_memory_kb"


def _asked(name: str, question: str, annotation: Any, given: dict[str, Any]) -> Any:
    """One answer; None: nobody knows."""
    import questionary

    from shapegcode.setup.answers import Answers

    choices = _choices(annotation)
    field = Answers.model_fields[name]
    if choices:
        open_ended = [] if field.default in choices else [_NOBODY_KNOWS]
        said = questionary.select(question, choices=[*choices, *open_ended]).unsafe_ask()
        return None if said == _NOBODY_KNOWS else said
    unit = str((field.json_schema_extra or {}).get("unit", "")) if isinstance(field.json_schema_extra, dict) else ""
    needed = name == "name" or (name == "rapid_mm_per_min") or name == "dnc_baud"
    hint = f" [{unit}]" if unit else ""
    hint += "" if needed else " (Enter: nobody knows)" if name != "dump" else " (its file, or Enter: no)"
    text = questionary.text(question + hint, validate=lambda typed: _problem(name, typed, needed, given)).unsafe_ask()
    return _parsed(name, text)


def _choices(annotation: Any) -> list[str]:
    """Of a question with a few answers; empty for every other one."""
    words = [each for option in (annotation, *get_args(annotation)) for each in get_args(option)]
    return list(dict.fromkeys(each for each in words if isinstance(each, str)))


def _parsed(name: str, typed: str) -> Any:
    """A text, a number, or one number for each axis."""
    text = typed.strip()
    if not text:
        return None
    if name in ("name", "dump"):
        return text
    numbers = [float(part) for part in text.replace(",", " ").split()]
    if len(numbers) == 3:
        return dict(zip("xyz", numbers, strict=True))
    if len(numbers) != 1:
        raise ValueError(f"{len(numbers)} numbers")
    return int(numbers[0]) if name == "dnc_baud" else numbers[0]


def _problem(name: str, typed: str, needed: bool, given: dict[str, Any]) -> bool | str:
    """True, or what is wrong with an answer; the question is then asked again."""
    from shapegcode.errors import FileError
    from shapegcode.setup.answers import read_answers

    if not typed.strip():
        return "needed: nothing works without it" if needed else True
    try:
        value = _parsed(name, typed)
    except ValueError:
        return f"{typed}: must be a number, or three with commas between (X, Y, Z)"
    if name == "dump" and not Path(str(value)).is_file():
        return f"{value}: no such file"
    try:
        read_answers({"name": "m", "rapid_mm_per_min": 1.0} | _alone(name, given | {name: value}))
    except FileError as error:
        return "; ".join(str(problem) for problem in error.problems)
    return True


def _vibration() -> dict[str, str]:
    """Of each axis: tapped, known, rigid, or not known. Nothing is taken from another machine."""
    import questionary

    said = {}
    for axis in "xyz":
        question = f"{axis.upper()}: tapped, from a data sheet, or taken as rigid?"
        kind = _VIBRATION[questionary.select(question, choices=list(_VIBRATION)).unsafe_ask()]
        if kind == "file":
            kind = questionary.text(
                "File of the tap test (CSV, UFF, WAV)",
                validate=lambda typed: Path(typed.strip()).is_file() or f"{typed}: no such file",
            ).unsafe_ask()
        elif kind == "known":
            kind = questionary.text("Frequency in Hz and damping ratio, such as 46:0.02", validate=_mode).unsafe_ask()
        said[axis] = kind.strip()
    return said


def _mode(typed: str) -> bool | str:
    from shapegcode.setup.answers import is_mode

    return is_mode(typed) or f"{typed}: must be FREQUENCY:DAMPING in Hz, such as 46:0.02"
