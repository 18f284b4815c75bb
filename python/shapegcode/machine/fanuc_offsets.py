"""Tables of offsets and variables of a control, put into the machine: `[input]`."""

from __future__ import annotations

from shapegcode.machine.fanuc_draft import Draft
from shapegcode.machine.fanuc_program import inch_factor, increment_um
from shapegcode.machine.fanuc_tables import ControlTables
from shapegcode.machine.result import ReadTable

__all__ = ["take_tables"]

_KEYS = {10: "tool_length_mm", 11: "tool_length_wear_mm", 12: "tool_radius_mm", 13: "tool_radius_wear_mm"}


def take_tables(draft: Draft, tables: ControlTables) -> None:
    """Offsets and variables as they stood when they were punched."""
    _tools(draft, tables)
    _systems(draft, tables)
    _variables(draft, tables)
    for file, line, words in tables.left_out:
        draft.miss("", f'{file}: "{words}": read, but not used', line)


def _tools(draft: Draft, tables: ControlTables) -> None:
    if not tables.tools:
        return
    # One value for all (memory A), geometry and wear (B), or each of length and radius (C).
    memory = "C" if tables.kinds & {12, 13} else "B" if tables.kinds & {10, 11} else "A"
    _put(draft, tables, "tools", "controller.offset_memory", memory, 1)
    halved = 2.0 if draft.values.bit(5004, 2) else 1.0
    mm = {
        kind: {number: round(_mm(draft, *each), 9) for number, each in rows.items()}
        for kind, rows in tables.tools.items()
    }
    filled = {number for rows in mm.values() for number, value in rows.items() if value}
    for kind, key in _KEYS.items():
        source = kind if memory == "C" else 1 if memory == "A" else 10 if kind in (10, 12) else 11
        if memory == "A" and kind in (11, 13):
            continue
        divisor = halved if kind in (12, 13) else 1.0
        rows = {str(n): value / divisor for n, value in sorted(mm.get(source, {}).items()) if n in filled}
        if kind in (11, 13):
            rows = {number: value for number, value in rows.items() if value}
        _put(draft, tables, "tools", f"input.{key}", rows, len(rows))
    if len(filled) < (total := len({n for rows in mm.values() for n in rows})):
        file, _, last = tables.sources["tools"]
        draft.miss("", f"{file}: {total - len(filled)} of {total} tool offsets are zero throughout: left out", last)
    if halved == 2.0:
        draft.assume("input.tool_radius_mm", "halved", "5004#2: cutter compensation is set as a diameter")


def _mm(draft: Draft, value: float, point: bool) -> float:
    """A value of a table: with a point in mm, or inch where that is the setting; without one in least increments."""
    return value * (inch_factor(draft) if point else increment_um(draft)[0] / 1000)


def _systems(draft: Draft, tables: ControlTables) -> None:
    if not tables.systems:
        return
    rows = {name: [_mm(draft, *axes.get(axis, (0.0, True))) for axis in "XYZ"] for name, axes in tables.systems.items()}
    shift = rows.pop("", [0.0, 0.0, 0.0])
    sums = {name: tuple(round(a + b, 9) for a, b in zip(each, shift, strict=True)) for name, each in rows.items()}
    offsets = {name: each for name, each in sums.items() if any(each)}
    _put(draft, tables, "systems", "input.work_offsets", offsets, len(offsets))


def _variables(draft: Draft, tables: ControlTables) -> None:
    if not tables.variables:
        return
    given = {str(n): value for n, value in sorted(tables.variables.items()) if value is not None}
    _put(draft, tables, "variables", "input.variables", given, len(given))


def _put(draft: Draft, tables: ControlTables, group: str, key: str, value: object, count: int) -> None:
    file, first, last = tables.sources[group]
    draft.put(key, value)
    draft.remarks[key] = f"FANUC {file}: as it was when it was punched"
    draft.tables.append(ReadTable(file, first, last, key, count))
