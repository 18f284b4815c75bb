"""Arguments that several commands share, and how their values are read."""

from __future__ import annotations

import argparse
import math
import tomllib
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from shapegcode.machine import Machine

_TIME_UNITS = {"ms": 1e-3, "us": 1e-6, "s": 1.0}


def add_machine_argument(parser: argparse.ArgumentParser) -> None:
    """Declare ``-m MACHINE`` and ``--set KEY=VALUE``."""
    parser.add_argument(
        "-m",
        "--machine",
        metavar="MACHINE",
        required=True,
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


def load_machine(args: argparse.Namespace) -> Machine:
    """The machine of ``-m`` with the values of ``--set``.

    Raises:
        MachineError: a bad file, key or value.
    """
    from shapegcode.machine import Machine, MachineError, Problem

    machine = Machine.load(args.machine)
    if not args.set:
        return machine
    data = machine.model_dump(exclude_none=True)
    for assignment in args.set:
        key, sign, text = assignment.partition("=")
        if not sign:
            raise MachineError("--set", (Problem(assignment, "", "must be KEY=VALUE"),))
        *tables, last = key.strip().split(".")
        place: Any = data
        for name in tables:
            place = place.setdefault(name, {}) if isinstance(place, dict) else None
        if not isinstance(place, dict):
            raise MachineError("--set", (Problem(key, text, "no such key"),))
        place[last] = _toml_value(text)
    return Machine.from_data(data, f"{args.machine} with --set")


def _toml_value(text: str) -> Any:
    # A bare word is a string: quotes would have to be escaped from the shell.
    try:
        return tomllib.loads(f"value = {text}")["value"]
    except tomllib.TOMLDecodeError:
        return text


def ratio(text: str) -> float:
    """A share such as ``60%`` or ``0.6``, above 0 and at most 1."""
    value = _number(text.removesuffix("%")) / (100.0 if text.endswith("%") else 1.0)
    if not 0.0 < value <= 1.0:
        raise argparse.ArgumentTypeError(f"{text!r}: must be above 0 and at most 100%")
    return value


def seconds(text: str) -> float:
    """A time such as ``5ms`` or ``0.005s``; a bare number counts as seconds."""
    for unit, factor in _TIME_UNITS.items():
        if text.endswith(unit):
            value = _number(text[: -len(unit)]) * factor
            break
    else:
        value = _number(text)
    if not (math.isfinite(value) and value > 0.0):
        raise argparse.ArgumentTypeError(f"{text!r}: must be a time above 0, for example 5ms")
    return value


def _number(text: str) -> float:
    try:
        return float(text)
    except ValueError:
        raise argparse.ArgumentTypeError(f"{text!r} is no number") from None
