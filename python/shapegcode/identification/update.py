"""Writes identified modes of one axis, and decisions on the others, into a machine file; the rest is not changed."""

import copy
import math
import re
import tomllib
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from operator import itemgetter
from pathlib import Path
from typing import Any

import numpy as np
import tomlkit
from scipy.optimize import linear_sum_assignment
from tomlkit.items import AoT, Key, SingleKey, Table, Whitespace

from shapegcode.errors import ArgumentError, MachineError
from shapegcode.hints import Hinted
from shapegcode.identification.across import MIN_MOVE, significant_motions
from shapegcode.identification.result import Estimate, Identification, IdentifiedMode, MachineFile
from shapegcode.machine import Machine, check_axes
from shapegcode.settings import edit
from shapegcode.settings.keys import remarks_of, toml
from shapegcode.settings.load import read_text


@dataclass(frozen=True)
class MachineUpdate(Hinted):
    """A machine file with identified modes, not yet written.

    Attributes:
        text: content of the file, to be written as UTF-8 without translating line ends.
        machine: the machine of this text.
        notes: replaced, kept, removed and added modes, one sentence each.
    """

    text: str
    machine: Machine
    notes: tuple[str, ...]

    def __repr__(self) -> str:
        notes = "; ".join(self.notes)
        return f"<MachineUpdate of {self.machine.name}, to be written: Path(file).write_text(update.text); {notes}>"

    def noted_in(self, found: Identification, path: str | Path) -> Identification:
        """Set `machine_file` in the identification.

        Args:
            found: identification whose modes are in the text.
            path: path of the written file.

        Returns:
            A copy with `machine_file`.
        """
        assert found.axis is not None
        return replace(found, machine_file=MachineFile(str(path), found.axis, self.notes))


def update_machine(path: str | Path, found: Identification, *, keep_modes: str = "", rigid: str = "") -> MachineUpdate:
    """Insert the modes of an identification into a machine file.

    Args:
        path: of the machine file, which is not changed.
        found: with modes, and the axis along which they were measured.
        keep_modes: other axes whose modes stay although not measured on this machine, such as "yz".
        rigid: other axes without a significant mode; their modes are deleted.

    Returns:
        The text to write, its machine, and notes of the changes.

    Raises:
        ArgumentError: no axis, no supported mode, a built-in machine, or undecided modes of other axes.
        MachineError: the file is invalid, or would become so.
        OSError: it cannot be read.
    """
    if found.axis is None:
        cure = "add --axis x, y or z; in Python ReadOptions(axis=...)"
        raise ArgumentError(f"{found.files[0]} does not say along which axis it was measured: {cure}")
    check_updatable(path)
    text = read_text(Path(path), MachineError)
    return update_modes(
        text, found.axis, found.modes, source=found.source, refused=found.refused, keep_modes=keep_modes, rigid=rigid,
        file=str(path),
    )  # fmt: skip


def check_updatable(path: str | Path) -> Machine:
    """Read the machine before the calculation; refuse a built-in one, which `update_machine` could not change."""
    if not isinstance(path, str | Path):
        raise ArgumentError(f"the file of a machine is needed, not {type(path).__name__}")
    if isinstance(path, str) and path in Machine.builtin_names():
        raise ArgumentError(
            f"{path} is a built-in machine, which stays as it is: shapegcode machine init {path} -o mine.toml makes a "
            "file of it that can be updated"
        )
    return Machine.load(path)


def update_modes(
    text: str,
    axis: str,
    modes: Sequence[IdentifiedMode],
    *,
    source: str,
    refused: Sequence[IdentifiedMode] = (),
    keep_modes: str = "",
    rigid: str = "",
    file: str = "<text>",
) -> MachineUpdate:
    """Replace the modes of one axis in the text of a machine file by identified ones; idempotent.

    A mode within 10 % of one in the file overwrites its values there. Values that the new mode lacks stay, except a
    mass; so does a frequency uncertainty that is larger than the new one and was not measured. A mode of the file
    within 10 % of a refused one stays unchanged. The axis' remaining tables are deleted; identified modes
    without a table get new ones.
    """
    if axis not in ("x", "y", "z"):
        raise ArgumentError(f"axis {axis!r}: must be x, y or z")
    if not modes:
        raise ArgumentError(f"no supported mode: {file} is unchanged")
    for mode in modes:
        if mode.refusal:
            raise ArgumentError(f"the mode at {mode.frequency_hz.value:g} Hz is not supported: {mode.refusal}")
    mark = "\ufeff" if text.startswith("\ufeff") else ""
    body = text.removeprefix(mark)
    if axis in rigid:
        raise ArgumentError(f"{axis.upper()}: it cannot be rigid, as a mode of it was measured")
    require_decisions(open_modes(Machine.from_toml(body, file), axis), keep_modes, rigid, file)
    tables = ModeTables(body, axis, source, file)
    new, notes = decide_axes(tables.put(modes, refused), keep_modes, rigid, file)
    machine = Machine.from_toml(new, file)
    named = zip("XYZ", machine.axes.as_tuple(), strict=True)
    if unknown := [name for name, each in named if not each.modes and not each.rigid]:
        say = f"add --rigid {''.join(unknown)}; until then assumed rigid"
        notes.append(f"no mode of {', '.join(unknown)} is known: tap, or {say}")
    return MachineUpdate(mark + new, machine, (*tables.notes, *notes))


_KEPT = ", kept"
_ORIGIN = re.compile(r"^(from [^:]*|assumed|not known|not measured)")


def open_modes(machine: Machine, measured: str | None) -> dict[str, str]:
    """Modes of axes other than `measured` that were neither measured on this machine nor marked as kept, by axis."""
    found: dict[str, list[str]] = {}
    for value in machine.values():
        parts = value.key.split(".")
        is_mode = parts[:1] == ["axes"] and parts[2:3] == ["modes"] and parts[-1] == "frequency_hz"
        if is_mode and parts[1] != measured and value.unmeasured and _KEPT not in value.remark:
            found.setdefault(parts[1], []).append(f"{value.value} Hz ({value.remark})")
    return {axis: ", ".join(modes) for axis, modes in found.items()}


def require_decisions(open_axes: Mapping[str, str], keep: str, rigid: str, file: str) -> None:
    """Refuse unmeasured modes of axes for which neither --keep-modes nor --rigid was given."""
    check_axes(keep, rigid)
    undecided = {axis: modes for axis, modes in open_axes.items() if axis not in keep + rigid}
    if undecided:
        said = "; ".join(f"{axis.upper()}: {modes}" for axis, modes in undecided.items())
        letters = "".join(undecided).upper()
        raise ArgumentError(
            f"{file}: modes that were not measured on this machine would stay, and make shapers longer: {said}. "
            f"--keep-modes {letters} keeps them (until they are tapped), --rigid {letters} takes them out"
        )


def decide_axes(text: str, keep: str, rigid: str, file: str) -> tuple[str, list[str]]:
    """Delete the modes of rigid axes from a file, and mark the modes kept on other axes."""
    notes: list[str] = []
    for axis in rigid:
        tables = ModeTables(text, axis, "", file)
        text = tables.make_rigid()
        notes += [f"{axis.upper()}: {note}" for note in tables.notes]

    def remark(key: str, said: str) -> str:
        parts = key.split(".")
        frequency = parts[:1] == ["axes"] and parts[1] in keep and parts[-1] == "frequency_hz"
        if not frequency or _KEPT in said:
            return said
        marked = _ORIGIN.sub(rf"\1{_KEPT}", said)
        if marked != said:
            notes.append(f"{parts[1].upper()}: kept, though not measured here ({said})")
        return marked

    return edit.with_remarks(text, remark), notes


_MEASURED = "half of the 95 % interval"
_DIGITS = 7
_KEYS = (
    *("frequency_hz", "damping_ratio", "frequency_uncertainty_percent", "damping_uncertainty_percent"),
    *("mass_kg", "mass_uncertainty_percent", "source"),
)


class ModeTables:
    """The modes of one axis in the text of a machine file."""

    def __init__(self, text: str, axis: str, source: str, file: str) -> None:
        self._remarks = remarks_of(text)
        text = edit.without_origins(text)
        self.newline = "\r\n" if text.partition("\n")[0].endswith("\r") else "\n"
        self._last_end = "" if text.endswith("\n") else self.newline
        self.document = edit.parse_exactly(text + self._last_end, file)
        self.data: dict[str, Any] = tomllib.loads(text)
        self.axis, self.source, self.file = axis, source, file
        self.notes: list[str] = []  # replaced, kept, removed and added modes, one sentence each
        self._gap: list[edit.Entry] = []  # the blank line after a deleted first table
        self.name = f"axes.{self.axis}.modes"
        self.old: list[dict[str, Any]] = list(self.data["axes"][self.axis].get("modes", []))
        self.expected: list[dict[str, Any]] = []
        self._said: dict[int, dict[str, str]] = {}  # by identity of a table: origins of the values written into it
        self.home = self._axis_table()
        held = (item.body for key, item in self.home.value.body if isinstance(item, AoT) and _is_modes(key, item))
        self.tables: list[Table] = next(held, [])
        self._before = list(self.tables)
        if len(self.tables) != len(self.old):
            raise ArgumentError(
                f"{self.file}: the modes of the {self.axis.upper()} axis are written inline; write each as a table "
                f"[[{self.name}]], then they can be updated"
            )

    def _axis_table(self) -> Table:
        for key, axes in self.document.body:
            if key is not None and key.key == "axes" and isinstance(axes, Table) and not key.is_dotted():
                for inner, table in axes.value.body:
                    if inner is not None and inner.key == self.axis and isinstance(table, Table):
                        return table
        raise self._no_place()

    def _no_place(self) -> ArgumentError:
        return ArgumentError(
            f"{self.file}: no position for a table [[{self.name}]]: write the axis as a table [axes.{self.axis}]"
        )

    def put(self, modes: Sequence[IdentifiedMode], refused: Sequence[IdentifiedMode]) -> str:
        """Write modes into the text; see `update.update_modes`."""
        old_hz = [each["frequency_hz"] for each in self.old]
        taken = matches(modes, old_hz)
        kept = {old: modes[mode] for mode, old in taken.items()}
        seen = {old: refused[mode] for mode, old in matches(refused, old_hz).items()}
        fresh = [mode for number, mode in enumerate(modes) if number not in taken]
        stay, left = self._old_tables(kept, seen)
        shares, meaning = shares_of(modes)
        share_of = dict(zip(map(id, modes), shares, strict=True))
        added = [self._table(mode, share_of[id(mode)], meaning) for mode in fresh]
        self._insert(stay, added, left)
        total = sum(float(mode.get("participation", 1.0)) for mode in self.expected)
        if total > 1.0 + 1e-3:  # of rounded participations
            listed = ", ".join(f"{share:g}" for share in shares)
            self.notes.append(
                f"warning: the participations of the {self.axis.upper()} axis sum to {total:.4g}: those of all modes "
                f"of one point sum to 1 when the axis moves; in the ratios of the modes found they would be {listed}"
            )
        said = self.data["axes"][self.axis].get("rigid")
        if said:
            self.notes.append("the mark as rigid is removed")
        if said or (said is False and self._remarks.get(f"axes.{self.axis}.rigid", "").startswith("assumed")):
            self._say_rigid(False, "a mode was measured")
        return self._finished([*stay, *added])

    def make_rigid(self) -> str:
        """Delete the modes of the axis and mark it as rigid."""
        _, left = self._old_tables({}, {}, "it is taken as rigid")
        entries = self.home.value.body
        place = next((n for n, (key, item) in enumerate(entries) if _is_modes(key, item)), len(entries))
        entries[place : place + 1] = [(None, item) for _, item in left]
        self._say_rigid(True, "decided: it has no significant mode")
        return self._finished([], rigid=True)

    def _finished(self, tables: Sequence[Table], *, rigid: bool = False) -> str:
        """The new text, checked, with the origins of the modes at their new places."""
        text = self.document.as_string()
        self._check(text, rigid)
        found = {key: remark for key, remark in self._remarks.items() if not key.startswith(self.name)}
        before = {id(table): number for number, table in enumerate(self._before, start=1)}
        for number, table in enumerate(tables, start=1):
            was = before.get(id(table))
            gone = self.old[was - 1].keys() - table.keys() if was else set()
            stem = f"{self.name}.{was}."
            old = {key.removeprefix(stem): said for key, said in self._remarks.items() if key.startswith(stem)}
            said = {key: remark for key, remark in old.items() if key not in gone} | self._said.get(id(table), {})
            found |= {f"{self.name}.{number}.{key}": remark for key, remark in said.items() if remark}
        return edit.with_origin_table(text, found)

    def _say_rigid(self, rigid: bool, remark: str) -> None:
        self._remarks[f"axes.{self.axis}.rigid"] = remark
        self._put(self.home.value.body, {"rigid": (rigid, remark)})

    def _old_tables(
        self, kept: Mapping[int, IdentifiedMode], seen: Mapping[int, IdentifiedMode], why: str = "which was not found"
    ) -> tuple[list[Table], list[edit.Entry]]:
        stay: list[Table] = []
        left: list[edit.Entry] = []
        for number, (table, old) in enumerate(zip(self.tables, self.old, strict=True)):
            if number in kept:
                self._change(table, old, kept[number])
            elif number in seen:
                old_hz, new_hz = toml(old["frequency_hz"]), seen[number].frequency_hz.value
                self.expected.append(old)
                self.notes.append(f"kept {old_hz} Hz unchanged: the test shows it at {new_hz:.6g} Hz, not well enough")
            else:
                self.notes.append(f"removed {toml(old['frequency_hz'])} Hz, {why}: {toml(old)}")
                tail = edit.take_tail(table)
                blank = tail[:1] if tail and isinstance(tail[0][1], Whitespace) else []
                left += tail[len(blank) :]
                self._gap = blank if number == 0 else self._gap
                continue
            table.trivia.indent = "".join(item.as_string() for _, item in left) + table.trivia.indent
            left = []
            stay.append(table)
        return stay, left

    def _check(self, text: str, rigid: bool) -> None:
        wanted = copy.deepcopy(self.data)
        axis = wanted["axes"][self.axis]
        axis["modes"] = self.expected
        if rigid or "rigid" in axis:
            axis["rigid"] = rigid
        try:
            found = tomllib.loads(text)
            found["axes"][self.axis].setdefault("modes", [])
            for each in (found, wanted):
                each["axes"][self.axis]["modes"].sort(key=itemgetter("frequency_hz"))
        except (tomllib.TOMLDecodeError, KeyError, AttributeError):
            found = {}
        if found != wanted:
            raise self._no_place()

    def _change(self, table: Table, old: dict[str, Any], mode: IdentifiedMode) -> None:
        entries = table.value.body
        values = self._values(mode)
        if mode.moves is not None and "moves" in old:
            values = {"moves": ({self.axis: 1.0}, "no motion along another axis is significant")} | values
        kept = ["participation " + toml(old.get("participation", 1.0))]
        stated = old.get("frequency_uncertainty_percent")
        if stated is not None and _MEASURED not in table["frequency_uncertainty_percent"].trivia.comment:
            measured = values["frequency_uncertainty_percent"][0]
            if stated > measured:
                del values["frequency_uncertainty_percent"]
                kept.append(f"frequency_uncertainty_percent = {toml(stated)}, wider than the measured {toml(measured)}")
        stays = ("frequency_over", "excited_by", *(() if "moves" in values else ("moves",)))
        kept += [f"{key} = {toml(old[key])}" for key in stays if key in old]
        for key in ("mass_kg", "mass_uncertainty_percent"):
            if key in old and key not in values:
                entries[:] = [entry for entry in entries if entry[0] is None or entry[0].key != key]
                self.notes.append(f"removed {key} = {toml(old[key])}: a decay without force gives no mass")
        self._put(entries, values)
        self._said[id(table)] = {key: remark for key, (_, remark) in values.items()}
        self.expected.append(
            {key: value for key, value in old.items() if key not in _KEYS}
            | {key: old[key] for key in ("frequency_uncertainty_percent",) if key in old}
            | {key: value for key, (value, _) in values.items()}
        )
        self.notes.append(
            f"{toml(values['frequency_hz'][0])} Hz replaces {toml(old['frequency_hz'])} Hz, which keeps "
            + "; ".join(kept)
        )

    def _put(self, entries: list[edit.Entry], values: Mapping[str, tuple[Any, str]]) -> None:
        """Set each value in the line of its key or commented key; if there is none, after the table's own keys."""
        below = next((n for n, (_, item) in enumerate(entries) if isinstance(item, Table)), len(entries))
        places = {edit.commented(entry, edit.COMMENTED_KEY): place for place, entry in enumerate(entries[:below])}
        places |= {key.key: place for place, (key, _) in enumerate(entries[:below]) if key is not None}
        added = []
        for key, (value, remark) in values.items():
            entry = tomlkit.parse(_line(key, value, remark) + self.newline).body[0]
            if key in places:
                entry[1].trivia.indent = entries[places[key]][1].trivia.indent
                entries[places[key]] = entry
            else:
                added.append(entry)
        place = edit.own_end(entries[:below])
        entries[place:place] = added

    def _values(self, mode: IdentifiedMode) -> dict[str, tuple[Any, str]]:
        values: dict[str, tuple[Any, str]] = {}
        for key in ("frequency_hz", "damping_ratio", "mass_kg"):
            estimate: Estimate | None = getattr(mode, key)
            if estimate is not None:
                low, high = (f"{end:.{_DIGITS}g}" for end in (estimate.low, estimate.high))
                values[key] = _rounded(estimate.value), f"95 %: {low} ... {high}"
                uncertain = key.partition("_")[0] + "_uncertainty_percent"
                values[uncertain] = _rounded_up(estimate.uncertainty_percent), _MEASURED
        values["source"] = self.source, ""
        values = {key: values[key] for key in _KEYS if key in values}
        significant = {
            letter: each for letter, each in significant_motions(mode).items() if abs(each.value) >= MIN_MOVE
        }
        if len(significant) > 1:  # motion along other axes is significant
            others = (
                f"{axis} {each.low:.3g} ... {each.high:.3g}" for axis, each in significant.items() if axis != self.axis
            )
            moves = {axis: _rounded(each.value, 4) for axis, each in significant.items()}
            values["moves"] = moves, f"95 %: {', '.join(others)}"
        return values

    def _table(self, mode: IdentifiedMode, share: float, meaning: str) -> Table:
        values = self._values(mode) | {"participation": (share, f"{meaning}, not measured")}
        self.expected.append({key: value for key, (value, _) in values.items()})
        self.notes.append(
            f"{toml(values['frequency_hz'][0])} Hz is new: participation {share:g} ({meaning}); how much of the "
            "axis' motion excites it was not measured"
        )
        lines = ["[[modes]]", *(_line(key, value, remark) for key, (value, remark) in values.items())]
        (_, tables), *_ = tomlkit.parse("".join(line + self.newline for line in lines)).body
        assert isinstance(tables, AoT)
        self._said[id(tables.body[0])] = {key: remark for key, (_, remark) in values.items()}
        return tables.body[0]

    def _insert(self, stay: list[Table], added: list[Table], left: list[edit.Entry]) -> None:
        """Insert new tables: after those that stay, else in place of the old or commented ones, else after the axis."""
        for table in added:
            table.trivia.indent = self.newline
        if self.tables:
            behind = edit.take_tail(stay[-1]) + left if stay else self._gap + left
            if not stay:
                added[0].trivia.indent = self.tables[0].trivia.indent.rstrip(" \t")
            self.tables[:] = [*stay, *added]
            self.tables[-1].value.body.extend(behind)
            return
        entries = self.home.value.body
        modes = (SingleKey("modes"), AoT(added, "modes", parsed=True))
        for place, entry in enumerate(entries):
            if edit.commented(entry, edit.COMMENTED_TABLE) == self.name:
                end = place + 1
                while end < len(entries) and edit.commented(entries[end], edit.COMMENTED_KEY):
                    end += 1
                entries[place:end] = [modes]
                return
        added[-1].value.body.extend(edit.take_tail(self.home))
        entries.append(modes)


def _is_modes(key: Key | None, item: object) -> bool:
    return key is not None and key.key == "modes" and isinstance(item, AoT)


def _rounded(value: float, digits: int = _DIGITS) -> float:
    return float(f"{value:.{digits}g}")


def _rounded_up(value: float) -> float:
    """Round an uncertainty in percent up to four digits; it then also covers the rounding of the estimated value."""
    if not math.isfinite(value):
        return value
    value += 100.0 * 0.5 * 10.0 ** (1 - _DIGITS)
    step = 10.0 ** (math.floor(math.log10(value)) - 3)
    return float(f"{math.ceil(value / step) * step:.4g}")


def _line(key: str, value: object, remark: str) -> str:
    return f"{key} = {toml(value)}" + (f"  # {remark}" if remark else "")


SAME_MODE = 0.1  # A mode is that of the file if its frequency differs by no more than this, relative to the old one
_NO_PAIR, _SHARE_DIGITS = 1e3, 4


def shares_of(modes: Sequence[IdentifiedMode]) -> tuple[list[float], str]:
    """Participations that sum to 1: as 1/m if all masses m are known, else equal; and a text that says which."""
    masses = [mode.mass_kg.value for mode in modes if mode.mass_kg is not None]
    if len(masses) < len(modes):
        return [_rounded(1.0 / len(modes), _SHARE_DIGITS)] * len(modes), "equal shares"
    total = sum(1.0 / mass for mass in masses)
    return [_rounded(1.0 / mass / total, _SHARE_DIGITS) for mass in masses], "share of the residues 1/m"


def matches(modes: Sequence[IdentifiedMode], old_hz: Sequence[float]) -> dict[int, int]:
    """Index of the old mode for new modes that have one: most pairs within 10 %, then the smallest sum of distances."""
    if not old_hz or not modes:
        return {}
    new_hz = np.array([mode.frequency_hz.value for mode in modes])
    distance = np.abs(new_hz[:, None] / np.asarray(old_hz) - 1.0)
    pairs = zip(*linear_sum_assignment(np.where(distance <= SAME_MODE, distance, _NO_PAIR)), strict=True)
    return {int(new): int(old) for new, old in pairs if distance[new, old] <= SAME_MODE}
