"""Options that stand for a key of the machine file: declared from what the key says of itself.

A new one needs a row in the command's table, option -> key; its help, choices and unit are the key's.
"""

from __future__ import annotations

import argparse
from collections.abc import Mapping
from types import UnionType
from typing import TYPE_CHECKING, Annotated, Any, Literal, get_args, get_origin

from shapegcode.cli.typed import micrometres, number, seconds

if TYPE_CHECKING:
    from shapegcode.machine import Machine

# How a value of a unit is typed on the command line: what is shown for it, what reads it, an example.
_TYPED = {
    "µm": ("LENGTH", micrometres, "5um"),
    "s": ("TIME", seconds, "5ms"),
    "%": ("PERCENT", lambda text: number(text.removesuffix("%")), "10%"),
}
_MOST_CHOICES_SHOWN = 4


def add_override_arguments(parser: argparse.ArgumentParser, keys: Mapping[str, str]) -> None:
    """Declare an option for each key, without a default: what is not typed is the machine's own."""
    for option, key in keys.items():
        meaning, unit, kind = _facts(key)
        said: dict[str, Any] = {"default": None}
        if kind is bool:
            said["action"] = argparse.BooleanOptionalAction
        elif get_origin(kind) is Literal:
            said["choices"] = get_args(kind)
            if len(said["choices"]) > _MOST_CHOICES_SHOWN:
                said["metavar"] = key.rpartition(".")[2].upper()
                meaning += f". One of {', '.join(said['choices'])}"
        elif unit in _TYPED:
            said["metavar"], said["type"], example = _TYPED[unit]
            meaning += f"; for example {example}"
        else:
            said["metavar"], said["type"] = unit.upper() or "N", number
        text = f"{meaning} (default: {key} of the machine file)".replace("%", "%%")
        parser.add_argument(option, help=text, **said)


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
