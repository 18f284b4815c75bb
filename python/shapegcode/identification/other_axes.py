"""The axes that were not tapped: modes that came from another machine are decided over, never kept in silence."""

from __future__ import annotations

import re
from collections.abc import Mapping

from shapegcode.errors import ArgumentError
from shapegcode.identification.mode_tables import ModeTables
from shapegcode.machine import Machine, check_axes
from shapegcode.settings.remarks import with_remarks

_KEPT = ", kept"
_ORIGIN = re.compile(r"^(from [^:]*|assumed|not known|not measured)")


def open_modes(machine: Machine, measured: str | None) -> dict[str, str]:
    """Modes of the other axes that nobody measured on this machine, and over which nobody decided."""
    found: dict[str, list[str]] = {}
    for value in machine.values():
        parts = value.key.split(".")
        is_mode = parts[:1] == ["axes"] and parts[2:3] == ["modes"] and parts[-1] == "frequency_hz"
        if is_mode and parts[1] != measured and value.unmeasured and _KEPT not in value.remark:
            found.setdefault(parts[1], []).append(f"{value.value} Hz ({value.remark})")
    return {axis: ", ".join(modes) for axis, modes in found.items()}


def require_decisions(open_axes: Mapping[str, str], keep: str, rigid: str, file: str) -> None:
    """Refuse modes over which nobody decided."""
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
    """Take the modes of rigid axes out of a file, and say of kept ones that they are."""
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

    return with_remarks(text, remark), notes
