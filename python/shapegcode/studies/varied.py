"""Which values are varied: what each is drawn from, and whether the converter knows of it.

A text is converted for the machine file. What is varied then is the machine that plays it: its modes, drives, filters,
times. A value that only the converter reads, such as `shaping.family`, needs another text.
"""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
import numpy.typing as npt

from shapegcode.errors import ArgumentError, MachineError, Problem
from shapegcode.machine import Machine
from shapegcode.settings.change import missing_row
from shapegcode.studies.distributions import Distribution, listed

Vary = Mapping[str, Distribution | Sequence[object] | npt.NDArray[Any]]
"""What each key is drawn from."""

# A machine may differ from its file in these, and they are read when blocks are played.
_PLAYED = re.compile(
    r"axes\.[xyz]\.(modes|rigid|drive\..+|rapid_mm_per_min)"
    r"|axes\.[xyz]\.modes\.\d+\.(frequency_hz|damping_ratio|participation|frequency_over(\..+)?)"
    r"|controller\.(interpolation_period_s|block_end|shaped_\w+|(position_gain_per_s|feed_forward_ratio)(\.[xyz])?)"
    r"|controller\.(in_position|rapid)\w*(\.[xyz])?"
    r"|shaping\.part_mass_kg|times\..+"
)
_SWINGS = re.compile(r"axes\.[xyz]\.(modes|rigid|drive)\b.*|shaping\.part_mass_kg")
# The file may leave out the table that holds it; `with_values` has the last word.
_OPTIONAL = re.compile(r"axes\.[xyz]\.(modes|drive)(\.|$)")
_TICK = "controller.interpolation_period_s"


@dataclass(frozen=True)
class Varied:
    """A key of the machine file and what its values are drawn from."""

    key: str  # dotted name
    distribution: Distribution  # of the values
    known: bool  # the converter knows each value; else only the machine that plays the text has it
    value: str  # what the file says, as TOML
    unit: str  # of the values

    @property
    def changes_times(self) -> bool:
        """Whether a program may take another time with it."""
        return not _SWINGS.fullmatch(self.key)


def check_keys(name: str, given: object) -> None:
    """Refuse what does not go by keys of the machine file."""
    if not isinstance(given, Mapping) or not all(isinstance(key, str) for key in given):
        said = f"{name} = {given!r}: must go by keys of the machine file"
        raise ArgumentError(f'{said}, such as {{"axes.x.modes.1.frequency_hz": ...}}')


def varied_values(machine: Machine, vary: Vary) -> tuple[Varied, ...]:
    """What is varied, checked against the keys that there are."""
    if not vary:
        raise ArgumentError("vary: nothing is varied: name at least one key of the machine file")
    check_keys("vary", vary)
    held = {value.key: value for value in machine.values()}
    found = []
    for key, given in vary.items():
        if isinstance(given, str) or not isinstance(given, Distribution | Sequence | np.ndarray):
            raise ArgumentError(f"vary: {key} = {given!r}: must be a distribution or a list of values")
        drawn = given if isinstance(given, Distribution) else listed(given)
        # Tables such as controller.in_position_s can be varied axis by axis.
        at = held.get(key) or held.get(key.rpartition(".")[0])
        wrong = missing_row(machine, key) or ("" if at or _OPTIONAL.match(key) else "no such key")
        if wrong:
            raise MachineError(machine.name, (Problem(key, "", wrong),))
        played = _PLAYED.fullmatch(key) is not None
        if drawn.known is False and not played:
            raise ArgumentError(f"vary: {key}: known = false: only the converter reads it, so that it must be known")
        known = not played if drawn.known is None else drawn.known
        found.append(Varied(key, drawn, known, at.value if at else "not set", at.unit if at else ""))
    return tuple(found)


def drawn_machine(machine: Machine, values: Mapping[str, object], source: str) -> Machine:
    """A machine with drawn values."""
    if not values:
        return machine
    # A control that ticks otherwise plays the same blocks; whether their period is a multiple is the converter's care.
    freed = {"emission.block_period_s": None} if _TICK in values and "emission.block_period_s" not in values else {}
    return machine.with_values({**freed, **values}, source=source)
