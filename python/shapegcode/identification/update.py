"""Identified modes put into a machine file: the modes of one axis change, everything else stays byte for byte."""

from __future__ import annotations

import copy
import math
import tomllib
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np
from scipy.optimize import linear_sum_assignment

from shapegcode._core import ArgumentError
from shapegcode.identification.mode import Estimate, IdentifiedMode
from shapegcode.machine import Machine
from shapegcode.settings.edit import Chunk, chunks, commented_key, commented_table
from shapegcode.settings.keys import toml

__all__ = ["MachineUpdate", "check_updatable", "update_machine_file", "update_modes"]

SAME_MODE = 0.1
"""Two frequencies, relative to the old one, within which a mode is taken as the one that the file has."""

_MEASURED = "half of the 95 % interval"
_DIGITS = 7
_NO_PAIR = 1e3
_SHARE_DIGITS = 4
_SUM_SLACK = 1e-3  # of the participations: rounding
_KEYS = (
    "frequency_hz",
    "damping_ratio",
    "frequency_uncertainty_percent",
    "damping_uncertainty_percent",
    "mass_kg",
    "mass_uncertainty_percent",
    "source",
)


@dataclass(frozen=True)
class MachineUpdate:
    """A machine file with identified modes in it; nothing is written yet.

    Attributes:
        text: the file, to be written as UTF-8 without translating line ends.
        machine: what it says.
        notes: what was replaced, kept, removed and added, one sentence each.
    """

    text: str
    machine: Machine
    notes: tuple[str, ...]


def update_machine_file(
    path: str | Path,
    axis: str,
    modes: Sequence[IdentifiedMode],
    *,
    source: str,
    refused: Sequence[IdentifiedMode] = (),
) -> MachineUpdate:
    """Read a machine file and put identified modes into it; see `update_modes`. The file itself is not touched.

    Raises:
        ArgumentError: a built-in machine; see `update_modes` too.
        MachineError: the file is bad, or would be.
        OSError: it cannot be read.
    """
    check_updatable(path)
    text = Path(path).read_bytes().decode("utf-8")
    return update_modes(text, axis, modes, source=source, refused=refused, file=str(path))


def check_updatable(path: str | Path) -> None:
    """Tell before the work what would make `update_machine_file` fail whatever the modes.

    Raises:
        ArgumentError: a built-in machine, or no regular file.
        MachineError: the file is bad.
        OSError: it cannot be read.
    """
    if isinstance(path, str) and path in Machine.builtin_names():
        raise ArgumentError(
            f"{path} is a built-in machine, which stays as it is: shapegcode machine init {path} -o mine.toml makes a "
            "file of it that can be updated"
        )
    if Path(path).exists() and not Path(path).is_file():
        raise ArgumentError(f"{path}: not a regular file")
    Machine.load(path)


def update_modes(
    text: str,
    axis: str,
    modes: Sequence[IdentifiedMode],
    *,
    source: str,
    refused: Sequence[IdentifiedMode] = (),
    file: str = "<text>",
) -> MachineUpdate:
    """The text of a machine file with the modes of one axis replaced by identified ones.

    A mode whose frequency is within 10 % of one in the file takes its table: values and uncertainties change where
    they stand, participation, `frequency_over` and every comment line stay, and so does an uncertainty of the
    frequency that somebody stated wider than it was measured. A mode of the file that the test shows, but does not
    support, stays as it is. Other tables of the axis' modes go, other modes get a table of their own, whose
    participation is its share of the residues. Putting the same modes in twice gives the same text.

    Args:
        text: of the machine file.
        axis: "x", "y" or "z".
        modes: what the data support.
        source: where they come from.
        refused: modes that the data show without supporting their values.
        file: name for messages.

    Raises:
        ArgumentError: no mode, one without support, no such axis, or modes that are not written as [[axes.x.modes]].
        MachineError: the result would not load.
    """
    if axis not in ("x", "y", "z"):
        raise ArgumentError(f"axis {axis!r}: must be x, y or z")
    if not modes:
        raise ArgumentError(f"no mode that the data support: {file} stays as it is")
    for mode in modes:
        if mode.refusal:
            raise ArgumentError(f"the mode at {mode.frequency_hz.value:g} Hz is not supported: {mode.refusal}")
    mark = "\ufeff" if text.startswith("\ufeff") else ""
    body = text.removeprefix(mark)
    edit = _Edit(chunks(body), tomllib.loads(body), axis, source, file)
    new = mark + edit.apply(modes, refused)
    edit.check(new.removeprefix(mark))
    return MachineUpdate(new, Machine.from_toml(new.removeprefix(mark), file), tuple(edit.notes))


@dataclass
class _Edit:
    """One change of a file's chunks."""

    parts: list[Chunk]
    data: dict[str, Any]
    axis: str
    source: str
    file: str
    notes: list[str] = field(default_factory=list)

    def __post_init__(self) -> None:
        self.path = ("axes", self.axis, "modes")
        self.name = ".".join(self.path)
        self.newline = "\r\n" if self.parts and self.parts[0].text.endswith("\r\n") else "\n"
        self.old: list[dict[str, Any]] = list(self.data["axes"][self.axis].get("modes", []))
        self.expected: list[dict[str, Any]] = []
        self.blocks = self._find_blocks()
        if len(self.blocks) != len(self.old):
            raise ArgumentError(
                f"{self.file}: the modes of the {self.axis.upper()} axis are written inline; write each as a table "
                f"[[{self.name}]], then they can be updated"
            )

    def apply(self, modes: Sequence[IdentifiedMode], refused: Sequence[IdentifiedMode]) -> str:
        """The text with the modes in it."""
        taken = _matches(modes, [each["frequency_hz"] for each in self.old])
        lines = [part.text for part in self.parts]
        kept = {old: mode for mode, old in taken.items()}
        seen = {
            old: refused[mode] for mode, old in _matches(refused, [each["frequency_hz"] for each in self.old]).items()
        }
        for number, (begin, end) in enumerate(self.blocks):
            if number in kept:
                self._change(lines, begin, end, self.old[number], modes[kept[number]])
            elif number in seen:
                old_hz, new_hz = toml(self.old[number]["frequency_hz"]), seen[number].frequency_hz.value
                self.expected.append(self.old[number])
                self.notes.append(f"kept {old_hz} Hz as it is: the test shows it at {new_hz:.6g} Hz, not well enough")
            else:
                lines[begin:end] = [""] * (end - begin)
                if end < len(self.parts) and self.parts[end].kind == "blank":
                    lines[end] = ""
                gone = self.old[number]
                self.notes.append(f"removed {toml(gone['frequency_hz'])} Hz, which was not found: {toml(gone)}")
        fresh = [mode for number, mode in enumerate(modes) if number not in taken]
        if fresh:
            shares, meaning = _shares(modes)
            share_of = dict(zip(map(id, modes), shares, strict=True))
            self._insert(
                lines, sorted({*kept, *seen}), [self._table(mode, share_of[id(mode)], meaning) for mode in fresh]
            )
        self._tell_sum(modes)
        return "".join(lines)

    def check(self, text: str) -> None:
        """The new text must say what is meant, and nothing else may have changed.

        Raises:
            ArgumentError: it does not, because of a layout that this module does not know.
        """
        wanted = copy.deepcopy(self.data)
        wanted["axes"][self.axis]["modes"] = self.expected
        try:
            found = tomllib.loads(text)
            found["axes"][self.axis]["modes"].sort(key=_frequency)
            wanted["axes"][self.axis]["modes"].sort(key=_frequency)
        except (tomllib.TOMLDecodeError, KeyError, AttributeError):
            found = {}
        if found != wanted:
            raise ArgumentError(
                f"{self.file}: no place for a table [[{self.name}]]: write the axis as a table [axes.{self.axis}]"
            )

    def _find_blocks(self) -> list[tuple[int, int]]:
        """First and last + 1 chunk of every table of the axis' modes."""
        heads = [number for number, part in enumerate(self.parts) if part.kind == "array" and part.path == self.path]
        return [(begin, self._end(begin)) for begin in heads]

    def _end(self, begin: int) -> int:
        """One behind the last key of a table, tables below it included, and behind the commented keys that follow."""
        path = self.parts[begin].path
        end, place = begin + 1, begin + 1
        while place < len(self.parts):
            part = self.parts[place]
            if part.is_head and (part.path == path or part.path[: len(path)] != path):
                break
            place += 1
            if part.kind == "key" or part.is_head:
                end = place
        for follower in range(end, place):
            if self.parts[follower].kind != "comment" or commented_table(self.parts[follower]):
                break
            if commented_key(self.parts[follower]):
                end = follower + 1
        return end

    def _change(self, lines: list[str], begin: int, end: int, old: dict[str, Any], mode: IdentifiedMode) -> None:
        """Put a mode into the lines of a table."""
        inner = range(begin + 1, end)
        below = next((number for number in inner if self.parts[number].is_head), end)
        keys = {self.parts[number].path[0]: number for number in range(begin + 1, below) if self.parts[number].path}
        places = {commented_key(self.parts[number]): number for number in range(begin + 1, below)} | keys
        values = self._values(mode)
        stated = old.get("frequency_uncertainty_percent")
        kept = ["participation " + toml(old.get("participation", 1.0))]
        if stated is not None and _MEASURED not in lines[keys["frequency_uncertainty_percent"]]:
            measured = values["frequency_uncertainty_percent"][0]
            if stated > measured:
                del values["frequency_uncertainty_percent"]
                kept.append(f"frequency_uncertainty_percent = {toml(stated)}, wider than the measured {toml(measured)}")
        kept += [f"{key} = {toml(old[key])}" for key in ("frequency_over",) if key in old]
        for key in ("mass_kg", "mass_uncertainty_percent"):
            if key in old and key not in values:
                lines[keys[key]] = ""
                self.notes.append(f"removed {key} = {toml(old[key])}: a decay without force gives no mass")
        added = ""
        for key, (value, remark) in values.items():
            line = _line(key, value, remark)
            if key in places:
                before = lines[places[key]]
                indent = before[: len(before) - len(before.lstrip())]
                ending = before[len(before.rstrip("\r\n")) :]
                lines[places[key]] = f"{indent}{line}{ending}"
            else:
                added += f"{line}{self.newline}"
        lines[below - 1] = _closed(lines[below - 1], self.newline if added else "") + added
        self.expected.append(
            {key: value for key, value in old.items() if key not in _KEYS}
            | {key: old[key] for key in ("frequency_uncertainty_percent",) if key in old}
            | {key: value for key, (value, _) in values.items()}
        )
        self.notes.append(
            f"{toml(values['frequency_hz'][0])} Hz replaces {toml(old['frequency_hz'])} Hz, which keeps "
            + "; ".join(kept)
        )

    def _values(self, mode: IdentifiedMode) -> dict[str, tuple[Any, str]]:
        """Value and remark of every key that the data give."""
        values: dict[str, tuple[Any, str]] = {}
        named: Mapping[str, Estimate | None] = {
            "frequency_hz": mode.frequency_hz, "damping_ratio": mode.damping_ratio, "mass_kg": mode.mass_kg,
        }  # fmt: skip
        for key, estimate in named.items():
            if estimate is not None:
                low, high = (f"{end:.{_DIGITS}g}" for end in (estimate.low, estimate.high))
                values[key] = _rounded(estimate.value), f"95 %: {low} ... {high}"
                uncertain = key.partition("_")[0] + "_uncertainty_percent"
                values[uncertain] = _rounded_up(estimate.uncertainty_percent), _MEASURED
        values["source"] = self.source, ""
        return {key: values[key] for key in _KEYS if key in values}

    def _table(self, mode: IdentifiedMode, share: float, meaning: str) -> str:
        """The lines of a new table."""
        values = self._values(mode) | {"participation": (share, f"{meaning}, not measured")}
        self.expected.append({key: value for key, (value, _) in values.items()})
        self.notes.append(
            f"{toml(values['frequency_hz'][0])} Hz is new: participation {share:g} ({meaning}), as a tap does not tell "
            "how much of the axis' motion goes into it"
        )
        lines = [f"[[{self.name}]]", *(_line(key, value, remark) for key, (value, remark) in values.items())]
        return "".join(line + self.newline for line in lines)

    def _tell_sum(self, modes: Sequence[IdentifiedMode]) -> None:
        """Warn of modes that together would move further than the axis does."""
        total = sum(float(mode.get("participation", 1.0)) for mode in self.expected)
        if total > 1.0 + _SUM_SLACK:
            shares = ", ".join(f"{share:g}" for share in _shares(modes)[0])
            self.notes.append(
                f"warning: the participations of the {self.axis.upper()} axis sum to {total:.4g}: those of all modes "
                f"of one point sum to 1 when the axis moves; by the shares of the modes found they would be {shares}"
            )

    def _insert(self, lines: list[str], kept: list[int], tables: list[str]) -> None:
        """Put new tables behind the last one that stays, or where the first one was, or where the axis ends."""
        if kept:
            last = self.blocks[kept[-1]][1] - 1
        elif self.blocks:
            begin, end = self.blocks[0]
            lines[begin] = self.newline.join(tables)
            if end < len(self.parts) and self.parts[end].kind == "blank":
                lines[end] = self.parts[end].text
            return
        else:
            last = self._behind_axis(lines)
        lines[last] = "".join([_closed(lines[last], self.newline), *(self.newline + table for table in tables)])

    def _behind_axis(self, lines: list[str]) -> int:
        """The last chunk of the axis' own table; a commented table of modes there makes room."""
        for number, part in enumerate(self.parts):
            if commented_table(part) == self.name:
                end = number + 1
                while end < len(self.parts) and commented_key(self.parts[end]):
                    end += 1
                lines[number:end] = [""] * (end - number)
                return number
        heads = [n for n, part in enumerate(self.parts) if part.kind == "table" and part.path == self.path[:2]]
        return self._end(heads[0]) - 1 if heads else len(self.parts) - 1


def _shares(modes: Sequence[IdentifiedMode]) -> tuple[list[float], str]:
    """Participations that sum to 1, and what they are: shares of the residues 1/m, or of the number of modes.

    Those of one point under a motion of its base do so, sum of phi_i Gamma_i = 1, for mode shapes that span the motion.
    """
    masses = [mode.mass_kg.value for mode in modes if mode.mass_kg is not None]
    if len(masses) < len(modes):
        return [_share(1.0 / len(modes))] * len(modes), "equal shares"
    total = sum(1.0 / mass for mass in masses)
    return [_share(1.0 / mass / total) for mass in masses], "share of the residues 1/m"


def _share(value: float) -> float:
    return float(f"{value:.{_SHARE_DIGITS}g}")


def _matches(modes: Sequence[IdentifiedMode], old_hz: Sequence[float]) -> dict[int, int]:
    """Number of the old mode by that of the new: as many pairs within 10 % as there can be, the nearest ones."""
    if not old_hz or not modes:
        return {}
    new_hz = np.array([mode.frequency_hz.value for mode in modes])
    distance = np.abs(new_hz[:, None] / np.asarray(old_hz) - 1.0)
    pairs = zip(*linear_sum_assignment(np.where(distance <= SAME_MODE, distance, _NO_PAIR)), strict=True)
    return {int(new): int(old) for new, old in pairs if distance[new, old] <= SAME_MODE}


def _rounded(value: float) -> float:
    return float(f"{value:.{_DIGITS}g}")


def _rounded_up(value: float) -> float:
    """To four digits, never less than it was; rounding the value itself is covered too."""
    if not math.isfinite(value):
        return value
    value += 100.0 * 0.5 * 10.0 ** (1 - _DIGITS)
    step = 10.0 ** (math.floor(math.log10(value)) - 3)
    return float(f"{math.ceil(value / step) * step:.4g}")


def _line(key: str, value: object, remark: str) -> str:
    return f"{key} = {toml(value)}" + (f"  # {remark}" if remark else "")


def _closed(line: str, newline: str) -> str:
    """A line that ends, so that another may follow."""
    return line if not line or line.endswith("\n") else line + newline


def _frequency(mode: dict[str, Any]) -> float:
    return float(mode["frequency_hz"])
