"""``shapegcode setup``: questions about a machine, and a short machine file of the answers."""

from __future__ import annotations

import argparse
import re
import sys
from collections.abc import Callable, Iterator
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Any, get_args

from shapegcode.cli.options import add_result_arguments

if TYPE_CHECKING:
    from shapegcode.setup.answers import Answers

__all__ = ["add_arguments", "ask_all", "run"]

_NOBODY_KNOWS = "nobody knows yet"
_TITLES = {
    "fanuc": "FANUC (0i, 16i, 18i, 21i, 30i, 31i, 32i)",
    "other": "another one that reads programs as FANUC does",
    "memory": "it is loaded into the memory",
    "dnc": "a line feeds it while it runs (DNC)",
    "data server": "from a data server, a memory card or a network",
    "none": "there is none, or it is never on",
    "G05.1": "G05.1 Q1 (AI contour control, AI advanced preview control: 0i, 30i)",
    "G08": "G08 P1 (advanced preview control)",
}
_UNITS = {"m/min": ("mm/min", 1000.0), "m/s²": ("mm/s²", 1000.0), "MB": ("kB", 1024.0), "mm": ("µm", 1000.0)}
"""What people say for a unit, and how much of it that is."""
_OF_AXES = ("rapid_mm_per_min", "max_feed_mm_per_min", "max_acceleration_mm_s2")
_ANY = 24_000.0  # mm/min: the rapid rate that a question is tried with
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
    parser.epilog = "example: shapegcode setup -o mine.toml"
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
        value = getattr(read_answers({"name": "m", "rapid_mm_per_min": _ANY} | _alone(name, given)), name)
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
        from shapegcode.setup.build import dump_lacks_rapids

        yield from ("max_feed_mm_per_min", "max_acceleration_mm_s2", "least_increment_mm")
        if not dump_lacks_rapids(given["dump"]):
            yield "rapid_mm_per_min"
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
        titled = [questionary.Choice(_TITLES.get(each, each), each) for each in (*choices, *open_ended)]
        said = questionary.select(question, choices=titled).unsafe_ask()
        return None if said == _NOBODY_KNOWS else said
    unit = _unit(name)
    needed = name == "name" or (name == "rapid_mm_per_min") or name == "dnc_baud"
    unknown = "" if needed else "Enter: none" if name == "dump" else "Enter: unknown"
    kind = "such as CNC-PARA.TXT" if name == "dump" else f"{unit}, or x, y, z" if name in _OF_AXES else unit
    said = "; ".join(filter(None, (kind, unknown)))
    hint = f" [{said}]" if said else ""
    return _parsed(name, _typed(question + hint, lambda typed: _problem(name, typed, needed, given)))


def _typed(question: str, check: Callable[[str], bool | str]) -> str:
    """One line, which is checked when Enter is pressed: asked again until it does."""
    import questionary

    said = questionary.text(question, validate=check, validate_while_typing=False).unsafe_ask()
    return str(said).strip()


def _unit(name: str) -> str:
    """Of a question; empty: it has none."""
    from shapegcode.settings.keys import facts
    from shapegcode.setup.answers import Answers

    return str(facts(Answers.model_fields[name]).get("unit", ""))


def _choices(annotation: Any) -> list[str]:
    """Of a question with a few answers; empty for every other one."""
    words = [each for option in (annotation, *get_args(annotation)) for each in get_args(option)]
    return list(dict.fromkeys(each for each in words if isinstance(each, str)))


def _parsed(name: str, typed: str) -> Any:
    """A text, a number, or one number for each axis; a unit may stand behind.

    Raises:
        ValueError: it is none.
    """
    text = typed.strip()
    if not text:
        return None
    if name in ("name", "dump"):
        return text
    found = re.fullmatch(r"([-+.\d\s,;/]*\d\.?)\s*([^\d\s].*)?", text)
    if found is None:
        raise ValueError(text)
    numbers = [float(part) for part in re.split(r"[\s,;/]+", found[1])]
    unit, said = _unit(name), (found[2] or "").replace("s2", "s²").replace("um", "µm")
    if said not in ("", unit):
        into, factor = _UNITS.get(said, ("", 0.0))
        if into != unit:
            raise ValueError(said)
        numbers = [number * factor for number in numbers]
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
        of_axes = ", or three with commas between (X, Y, Z)" if name in _OF_AXES else ""
        return f"{typed}: must be a number in {_unit(name)}{of_axes}"
    if name == "dump":
        if not Path(str(value)).is_file():
            return f"{value}: no such file"
        from shapegcode.setup.build import dump_problem

        return dump_problem(str(value)).replace("\n", "; ") or True
    try:
        read_answers({"name": "m", "rapid_mm_per_min": _ANY} | _alone(name, given | {name: value}))
    except FileError as error:
        return "; ".join(f"{problem.value}: {problem.limit}" for problem in error.problems)
    return True


def _vibration() -> dict[str, str]:
    """Of each axis: tapped, known, rigid, or not known. Nothing is taken from another machine."""
    import questionary

    said = {}
    for axis in "xyz":
        question = f"{axis.upper()}: tapped, from a data sheet, or taken as rigid?"
        kind = _VIBRATION[questionary.select(question, choices=list(_VIBRATION)).unsafe_ask()]
        if kind == "file":
            kind = _typed("File of the tap test (CSV, UFF, WAV)", _tap)
        elif kind == "known":
            kind = _typed("Frequency in Hz and damping ratio, such as 46:0.02", _mode)
        said[axis] = kind
    return said


def _tap(typed: str) -> bool | str:
    from shapegcode.setup.build import tap_problem

    file = typed.strip()
    return tap_problem(file).replace("\n", "; ") or True if Path(file).is_file() else f"{file}: no such file"


def _mode(typed: str) -> bool | str:
    from shapegcode.errors import FileError
    from shapegcode.setup.answers import is_mode, read_answers

    if not is_mode(typed.strip()):
        return f"{typed}: must be FREQUENCY:DAMPING in Hz, such as 46:0.02"
    try:
        read_answers({"name": "m", "rapid_mm_per_min": _ANY, "modes": {"x": typed.strip()}})
    except FileError as error:
        return "; ".join(problem.limit for problem in error.problems)
    return True
