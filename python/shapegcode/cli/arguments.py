"""The parser of every command: options in groups, examples, and parsers of the values."""

from __future__ import annotations

import argparse
import math
import re
import textwrap
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from functools import cache
from importlib import resources
from typing import Any, NoReturn

_MAX_OVERRIDE = 2.54  # of a control
_SIZE_UNITS = {"": 1, "k": 1024, "M": 1024**2, "G": 1024**3}
_LENGTH_UNITS = {"um": 1.0, "µm": 1.0, "mm": 1e3}
_TIME_UNITS = {"s": 1.0, "ms": 1e-3, "us": 1e-6}


def _refuse(text: str, must: str) -> NoReturn:
    raise argparse.ArgumentTypeError(f"{text!r}: must be {must}")


def program_number(text: str) -> int:
    """Parse an O number with or without its letter."""
    match = re.fullmatch(r"[Oo]?0*([1-9][0-9]{0,7})", text)
    return int(match[1]) if match else _refuse(text, "a program number, O1 ... O99999999")


def program_choice(text: str) -> int | str:
    """Parse the choice of a program in a file: O number, address, or ``all``."""
    if text == "all" or re.fullmatch(r"#[1-9][0-9]{0,8}|(.*/)?<[^<>]+>|.*/[Oo]?[0-9]{1,8}", text):
        return text
    try:
        return program_number(text)
    except argparse.ArgumentTypeError as error:
        raise argparse.ArgumentTypeError(f"{error}, /FOLDER/O1, <NAME>, #3 for the third one, or all") from None


def axes(text: str) -> str:
    """Parse axes such as ``XZ``, ``x,z`` or ``"x z"``."""
    letters = set(re.sub(r"[\s,]+", "", text.lower()))
    if not letters or letters - set("xyz"):
        _refuse(text, "axes, for example X or XZ")
    return "".join(sorted(letters))


def line_range(text: str) -> tuple[int, int]:
    """Parse lines such as ``120-180`` or ``120``: first and last, from 1."""
    match = re.fullmatch(r"0*([1-9][0-9]{0,9})(?:-0*([1-9][0-9]{0,9}))?", text)
    first, last = (int(match[1]), int(match[2] or match[1])) if match else (1, 0)
    return (first, last) if first <= last else _refuse(text, "lines, first to last, for example 120-180")


def line_ranges(text: str) -> tuple[tuple[int, int], ...]:
    """Parse ranges of lines such as ``12-80,95-240``."""
    return tuple(line_range(part.strip()) for part in text.split(","))


def count(text: str) -> int:
    """A whole number, 1 or more."""
    match = re.fullmatch(r"0*([1-9][0-9]{0,11})", text)
    return int(match[1]) if match else _refuse(text, "a whole number, 1 or more")


def number(text: str) -> float:
    """A number."""
    try:
        return float(text)
    except ValueError:
        raise argparse.ArgumentTypeError(f"{text!r} is not a number") from None


def _share(text: str) -> float:
    return number(text.removesuffix("%")) / (100.0 if text.endswith("%") else 1.0)


def _where(parse: Callable[[str], float], holds: Callable[[float], bool], must: str) -> Callable[[str], float]:
    """A parser of numbers for which a condition holds."""

    def parsed(text: str) -> float:
        return value if holds(value := parse(text)) else _refuse(text, must)

    return parsed


positive = _where(number, lambda value: 0.0 < value < math.inf, "above 0")
nonzero = _where(number, lambda value: math.isfinite(value) and value != 0.0, "a number other than 0")
ratio = _where(_share, lambda value: 0.0 < value <= 1.0, "above 0 and at most 100%")  # such as 60% or 0.6
share = _where(_share, lambda value: 0.0 <= value < 1.0, "at least 0 and below 100%")  # such as 3% or 0.03
override = _where(_share, lambda value: 0.0 < value <= _MAX_OVERRIDE, f"above 0 and at most {_MAX_OVERRIDE:.0%}")


def seconds(text: str) -> float:
    """A time with its unit, such as ``5ms`` or ``0.005s``."""
    return _with_unit(text, "time", _TIME_UNITS, "5ms")


def start_time(text: str) -> float:
    """A time with its unit, or 0 without unit."""
    return 0.0 if text in ("0", "0s", "0ms") else seconds(text)


def frequency_band(text: str) -> tuple[float, float]:
    """Two frequencies in Hz such as ``20:400``, ascending."""
    try:
        low, high = map(float, text.split(":"))
    except ValueError:
        low, high = math.nan, math.nan
    return (low, high) if 0.0 <= low < high < math.inf else _refuse(text, "two frequencies in Hz, for example 20:400")


def micrometres(text: str) -> float:
    """A length with its unit, such as ``5um`` or ``0.005mm``, in µm."""
    return _with_unit(text, "length", _LENGTH_UNITS, "5um")


def _with_unit(text: str, what: str, units: Mapping[str, float], example: str) -> float:
    """A number above 0 with one of the units, converted by its factor."""
    match = re.fullmatch(rf"([-+.\d]+(?:[eE][-+]?\d+)?)\s*({'|'.join(units)})", text)
    try:
        value = float(match[1]) * units[match[2]] if match else 0.0
    except ValueError:
        value = 0.0
    typed = ", ".join(unit for unit in units if unit.isascii())
    good = math.isfinite(value) and value > 0.0
    return value if good else _refuse(text, f"a {what} above 0 with its unit ({typed}), for example {example}")


def size(text: str) -> int:
    """A number of bytes above 0, such as ``262144``, ``256k``, ``1M`` or ``2G``; k, M, G are powers of 1024."""
    match = re.fullmatch(r"(\d+(?:\.\d+)?)([kMG]?)", text)
    value = math.floor(float(match[1]) * _SIZE_UNITS[match[2]]) if match else 0
    return value if value >= 1 else _refuse(text, "a number of bytes above 0, for example 65536, 64k or 1M")


@cache
def examples() -> dict[str, list[str]]:
    """Example command lines by command and action; a test parses each."""
    found: dict[str, list[str]] = {}
    below: list[str] = []
    text = (resources.files("shapegcode") / "data" / "examples.txt").read_text(encoding="utf-8")
    for line in text.splitlines():
        if line.startswith(" "):
            below.append(line)
        else:
            below = found[line.rstrip(":")] = []
    return found


GROUPS: dict[str, tuple[str, ...]] = {
    "input": (
        "input", "inputs", "files", "dump", "name", "kind", "machine", "set", "program", "against", "shaped", "lines",
        "answers", "base", "programs", "compensation", "cut", "mode", "uncertainty", "axes", "axis", "units", "box",
        "override", "rapid_override", "part_mass", "shell", "sweep", "log_next",
    ),
    "what to do": ("write", "fit", "servo", "runs", "tap_plan", "list_families"),
    "what to shape": (
        "shaper", "contour", "per_axis", "planner", "shape_rapids", "arc_feed", "shape_all", "only", "leave",
        "block_period",
    ),
    "tolerance": (
        "at_least", "contour_tolerance", "vibration_limit", "max_duration", "max_abs_sum", "margin", "settling_band",
    ),
    "differences": ("allow",),
    "price": ("max_time_increase", "max_cut_time_increase", "tolerance_curve"),
    "budget": ("max_bytes", "baud", "max_blocks_per_second"),
    "cut": (
        "feed_schedule", "tool", "stock", "resolution", "tool_diameter", "spindle", "axial_depth", "feed", "feeds",
        "radial_depth", "length", "allowance", "rough_radius", "finish_radius", "interval", "intervals", "up",
        "forces_on", "chip_thickness", "edge_forces",
    ),
    "calculation": (
        "plant", "no_full", "look_ahead", "drive", "continuous", "family", "objective", "negative", "taps", "speed",
        "radius", "modes", "max_modes", "frequencies", "travel", "acceleration", "seconds", "ignore_force",
        "stops", "across", "start", "station", "cutoff", "lambda_s",
    ),
    "modes that were not measured on this machine": ("keep_modes", "rigid"),
    "missing in the file": (
        "time_column", "force_column", "response_columns", "time_unit", "force_unit", "response_unit", "period_s",
        "quantity", "force_scale", "response_scale", "force_sensitivity", "response_sensitivity", "response_first",
        "exponential_window_s",
    ),
    "runs": (
        "draws", "batch_command", "resume", "jobs", "time_limit", "memory_limit", "scheduler", "tls_ca", "tls_cert",
        "tls_key",
    ),
    "output": (
        "output", "dialect", "update", "write_origins", "force", "full", "csv", "npz", "every", "blocks", "plots",
        "json", "html", "html_script",
    ),
    "verbosity": ("quiet", "verbose", "cite"),
}  # fmt: skip
"""Destinations of the options of each group; one table, so that all commands list an option in the same group."""

_GROUP_OF = {dest: title for title, dests in GROUPS.items() for dest in dests}
_EXIT_CODES = "0 done and within tolerance; 1 done, but out of tolerance; 2 not done: bad input"


class _Formatter(argparse.HelpFormatter):
    """Wraps the description, and keeps the line breaks of the epilog."""

    def _fill_text(self, text: str, width: int, indent: str) -> str:
        if "\n" not in text:
            return super()._fill_text(text, width, indent)
        lines = []
        for line in text.split("\n"):
            # A command stays on one line, so that it can be copied.
            whole = line.startswith("  ")
            lines += [line] if whole else textwrap.wrap(line, width, break_long_words=False) or [""]
        return "\n".join(indent + line for line in lines)


class CommandParser(argparse.ArgumentParser):
    """A parser that puts each option into its group."""

    def __init__(self, **kwargs: Any) -> None:
        self._titled: dict[str, argparse._ArgumentGroup] = {}
        super().__init__(**({"formatter_class": _Formatter} | kwargs))

    def group(self, title: str) -> argparse._ArgumentGroup:
        """The group with that title, created on first use."""
        if title not in self._titled:
            self._titled[title] = self.add_argument_group(title)
        return self._titled[title]

    def add_argument(self, *names: str, **kwargs: Any) -> argparse.Action:
        """Declare an argument in its group."""
        title = _GROUP_OF.get(kwargs.get("dest") or _dest(names))
        if title is None:
            return super().add_argument(*names, **kwargs)
        return self.group(title).add_argument(*names, **kwargs)

    def format_help(self) -> str:
        """The help text, its groups in the order of `GROUPS`, with examples and exit codes below."""
        ranks = {title: rank for rank, title in enumerate(GROUPS, start=1)}
        # First the groups of argparse itself: options, actions.
        self._action_groups.sort(key=lambda group: ranks.get(group.title or "", 0))
        kept = self.epilog
        try:
            self.epilog = self.epilogue()
            return super().format_help()
        finally:
            self.epilog = kept

    def epilogue(self) -> str | None:
        """Text below the options: examples and exit codes."""
        words = self.prog.split(maxsplit=1)
        lines = examples().get(words[1] if len(words) > 1 else "")
        if not lines:
            return self.epilog
        # Unusual exit codes are explained in the description of the command.
        description = (self.description or "").lower()
        codes = "" if "exit code 0" in description else f"\n\nexit codes: {_EXIT_CODES}."
        return "\n".join(["examples:", *lines]) + codes + (self.epilog or "")


NEEDED = object()  # instead of a default: the option is required

Row = tuple[Any, ...]
"""An option: names, metavar, type, help and, if not None, the default or `NEEDED`.

Types: `bool` makes a switch, a tuple holds the allowed words, a list the type of a repeatable option, and a dictionary
arguments of argparse.
"""


@dataclass(frozen=True)
class OneOf:
    """Options of which at most one may be given, shown in a group of the help."""

    title: str
    rows: tuple[Row, ...]
    required: bool = False


@dataclass(frozen=True)
class OldName:
    """Former name of an option; not shown in the help."""

    old: str
    option: str


@dataclass(frozen=True)
class Interface:
    """Description, options and function of a command or of one of its actions."""

    description: str  # for the help; if empty, a command shows its line in the list of commands, an action nothing
    options: tuple[Row | OneOf | OldName, ...] = ()
    run: Callable[[argparse.Namespace], int] | None = None
    # actions by name, each with its line in the list of actions
    actions: Mapping[str, tuple[str, Interface]] = field(default_factory=dict)

    def declare(self, parser: argparse.ArgumentParser) -> None:
        """Add description, options, actions and function to a parser."""
        parser.description = self.description or parser.description
        for entry in self.options:
            if isinstance(entry, OldName):
                parser._option_string_actions[entry.old] = parser._option_string_actions[entry.option]
            elif isinstance(entry, OneOf):
                group = parser.group(entry.title) if isinstance(parser, CommandParser) else parser
                choice = group.add_mutually_exclusive_group(required=entry.required)
                for row in entry.rows:
                    _add_option(choice, *row)
            else:
                _add_option(parser, *entry)
        if self.actions:
            below = parser.add_subparsers(dest="action", metavar="ACTION", required=True, title="actions")
            for name, (line, action) in self.actions.items():
                action.declare(below.add_parser(name, help=line))
        if self.run is not None:
            parser.set_defaults(run=self.run)


def _add_option(
    parser: argparse._ActionsContainer, names: str, metavar: str | None, kind: Any, text: str, default: Any = None
) -> None:
    settings: dict[str, Any] = (
        {"required": True} if default is NEEDED else {} if default is None else {"default": default}
    )
    if kind is bool:
        settings["action"] = "store_true"
    else:
        how = {"choices": kind} if isinstance(kind, tuple) else kind if isinstance(kind, dict) else {"type": kind}
        how = {"action": "append", "type": kind[0]} if isinstance(kind, list) else how
        settings |= how if metavar is None else how | {"metavar": metavar}
    parser.add_argument(*names.split(), help=text, **settings)


def _dest(names: tuple[str, ...]) -> str:
    """The destination that argparse derives from the names."""
    long = next((name for name in names if name.startswith("--")), names[0] if names else "")
    return long.lstrip("-").replace("-", "_")
