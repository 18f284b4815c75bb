"""Program settings of a parameter dump: increments, power-on state, offsets, cycles, calls, serial line.

Sources of the meanings are in docs/reference/parameters.md, also which are unconfirmed.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence

from shapegcode.machine.fanuc_draft import Draft

_SERIAL = {0: 103, 1: 113, 2: 123, 3: 133}
"""Channel of 0020 -> parameter of its transfer speed; other channels are cards, networks, data servers."""
_BAUD = (0, 50, 100, 110, 150, 200, 300, 600, 1200, 2400, 4800, 9600, 19200, 38400, 57600, 76800, 115200)
_OFFSETS = tuple(range(1220, 1227))
NUMBERS = frozenset(
    (
        *(0, 20, *_SERIAL.values(), 1004, 1013, 1020, *_OFFSETS),
        *(3401, 3402, 3403, *range(3410, 3433)),
        *(5003, 5004, 5114, 5115, 5400, 6001, *range(6050, 6060), *range(6071, 6090)),
    )
)
"""Parameters that are read here."""


def take_program(draft: Draft) -> None:
    """Read all program settings."""
    _axes(draft)
    _increments(draft)
    _words_and_arcs(draft)
    _cycles_and_offsets(draft)
    _work_offsets(draft)
    _calls(draft)
    _serial_line(draft)


def _axes(draft: Draft) -> None:
    """Determine which of A1, A2, ... is X, Y, Z."""
    names = {
        float(entry.text): int(entry.target[1:])
        for (number, target), entry in draft.dump.entries.items()
        if number == 1020 and target.startswith("A")
    }
    if not names:
        draft.assume("axes", "A1, A2, A3", "no axis names (1020): A1 is X, A2 is Y, A3 is Z")
        return
    absent = [chr(code) for code in (88, 89, 90) if code not in names]
    if absent:
        draft.problem(1020, f"no axis is named {', '.join(absent)}")
        return
    draft.values.axes = (names[88], names[89], names[90])


def increment_um(draft: Draft) -> tuple[float, bool]:
    """Least increment of a metric axis, µm: 1013#1 is IS-C, #0 IS-A, neither IS-B; and whether it is in the dump."""
    number = _increment_parameter(draft)
    if number is None:
        return 1.0, False
    fine, coarse = draft.values.bit(number, 1), draft.values.bit(number, 0)
    return (0.1 if fine else 10.0 if coarse else 1.0), True


def _increment_parameter(draft: Draft) -> int | None:
    """Number of the parameter with the increment bits: 1013 per axis; in older series 1004 for all."""
    return next((n for n in (1013, 1004) if draft.values.bit(n, 1) is not None), None)


def _increments(draft: Draft) -> None:
    number = _increment_parameter(draft)
    if number is None:
        draft.miss(1013, "no increment system: IS-B is assumed, least increment 0.001 mm")
        return
    step_um, _ = increment_um(draft)
    steps = {draft.values.bit_of(entry, 1) for entry in draft.values.entries(number)}
    if len(steps) > 1:
        draft.assume(f"parameter {number}", "differs", "increment systems differ between the axes; that of X counts")
    draft.set("controller.least_increment_mm", round(step_um / 1000, 9), number)
    draft.set("controller.least_increment_inch", round(step_um / 10_000, 9), number)


def _words_and_arcs(draft: Draft) -> None:
    values = draft.values
    draft.choose("controller.calculator_decimal_point", 3401, 0)
    draft.choose("input.arc_without_centre", 3403, 5, "alarm", "line")
    entry = draft.dump.get(3410)
    if entry and (tolerance := _length_mm(draft, 3410)):
        note = "" if "." in entry.text else "whole number: in least increments"
        draft.set("controller.arc_radius_tolerance_mm", tolerance, 3410, note=note)
    elif entry:
        draft.miss(3410, "0: means no check on some series; not known here", entry.line)
    if draft.choose("power_on.motion", 3402, 0, "G01", "G00") is not None:
        draft.choose("power_on.plane", 3402, 2, "G19", "G18" if values.bit(3402, 1) else "G17")
        draft.choose("power_on.distance", 3402, 3, "G91", "G90")
    draft.choose("power_on.units", 0, 2, "G20", "G21")
    codes = {n: values.scalar(n, 99_999_999) for n in range(3411, 3433)}
    given = {n: int(code) for n, code in codes.items() if code}
    if given:
        draft.set("controller.no_buffer_m_codes", tuple(sorted(set(given.values()))), *given)


def _length_mm(draft: Draft, number: int) -> float | None:
    """Read a length without axes: with a point in mm or inch, without one in least increments."""
    value = draft.values.scalar(number, unit="mm")
    if value is None:
        return None
    entry = draft.dump.get(number) or draft.values.entries(number)[0]
    return value if "." in entry.text else round(value * increment_um(draft)[0] / 1000, 9)


def _cycles_and_offsets(draft: Draft) -> None:
    draft.choose("input.scale_unit", 5400, 7, 0.001, 0.00001)
    clearances = {n: _length_mm(draft, n) for n in (5114, 5115)}
    given = {n: mm for n, mm in clearances.items() if mm is not None}
    if given:
        largest = max(given.values())
        note = "" if min(given.values()) == largest else "G73 and G83 differ; the larger one counts for both"
        draft.set("input.peck_clearance_mm", largest, *given, note=note)
    if draft.values.bit(5003, 1):
        draft.miss(5003, "start-up of cutter compensation of type C: read, but not supported; type A or B is used")
    else:
        draft.choose("input.compensation_start_up", 5003, 0, "B", "A")


def _work_offsets(draft: Draft) -> None:
    """Read 1221 to 1226 (G54 to G59), each with 1220 added."""
    values, step_mm = draft.values, increment_um(draft)[0] / 1000
    found: dict[int, list[float]] = {}
    for number in _OFFSETS:
        entries = values.entries(number)
        if len(entries) == 3:
            mm = values.per_axis(number, unit="mm", low=-1e7) or []
            found[number] = [v if "." in e.text else v * step_mm for v, e in zip(mm, entries, strict=True)]
    shift = found.pop(1220, [0.0, 0.0, 0.0])
    if found:
        used = [number for number in _OFFSETS if number in found] + ([1220] if any(shift) else [])
        offsets = shifted({f"G{number - 1167}": each for number, each in found.items()}, shift)
        draft.set("input.work_offsets", offsets, *used)


def shifted(offsets: Mapping[str, Sequence[float]], shift: Sequence[float]) -> dict[str, tuple[float, ...]]:
    """Work offsets with the common shift added, without those that are zero."""
    sums = {name: tuple(round(a + b, 9) for a, b in zip(each, shift, strict=True)) for name, each in offsets.items()}
    return {name: each for name, each in sums.items() if any(each)}


def _calls(draft: Draft) -> None:
    """Read the G, M and T codes that call programs."""
    tables = (
        ("input.g_macros", range(6050, 6060), 9010),
        ("input.m_subprograms", range(6071, 6080), 9001),
        ("input.m_macros", range(6080, 6090), 9020),
    )
    for key, numbers, first in tables:
        codes = {n: draft.values.scalar(n, 99_999_999, low=-9999) for n in numbers}
        given = {n: int(code) for n, code in codes.items() if code and code > 0}
        for n in (n for n, code in codes.items() if code and code < 0):
            draft.miss(n, "a code that calls a macro in every block (negative): read, but not used")
        if any(code is not None for code in codes.values()):
            draft.set(key, {str(code): first + n - numbers[0] for n, code in given.items()}, *(given or codes))
    draft.choose("input.tool_program", 6001, 5, 9000, 0)


def _serial_line(draft: Draft) -> None:
    """Read the baud rate of the channel in 0020; without it programs are not drip fed."""
    channel = draft.values.scalar(20, 35)
    if channel is None:
        if draft.values.scalar(103) is not None:
            draft.miss(103, "no 0020: input channel not known; drip feed not assumed")
        return
    number = _SERIAL.get(int(channel))
    if number is None:
        draft.set("controller.dnc_baud", 0, 20)
        return
    speed = draft.values.scalar(number, 1000)
    if speed is None:
        draft.miss(number, f"transfer speed of channel {channel:g} (0020) is not in the dump")
    elif not speed < len(_BAUD):
        draft.miss(number, f"{speed:g}: not a code of a transfer speed (0 to {len(_BAUD) - 1})")
    elif speed:
        draft.set("controller.dnc_baud", _BAUD[int(speed)], 20, number)
