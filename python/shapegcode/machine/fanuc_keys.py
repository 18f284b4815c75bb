"""Set keys of the machine file from a parameter dump: motion, increments, power-on state, offsets, cycles, calls.

docs/reference/parameters.md states the source of each parameter's meaning, or that it is not confirmed.
"""

import math
from collections.abc import Mapping, Sequence

from shapegcode.io.units import MM_PER_INCH
from shapegcode.machine.fanuc_dump import LONGEST_MS, ControlTables, Draft
from shapegcode.machine.result import ReadTable

_LAW = (1401, 1420, 1422, 1430, 1432, 1602, 1603, 1604, 1610, 1620, 1621, 1622, 1623, 1660, 1730, 1731, 1732)
_AHEAD = (1735, 1737, 1769, 1770, 1771, 1772, 1773, 1774, 1783)
_SERIAL = {0: 103, 1: 113, 2: 123, 3: 133}
"""Parameter of the baud rate by I/O channel (0020); other channels are cards, networks, data servers."""
_BAUD = (0, 50, 100, 110, 150, 200, 300, 600, 1200, 2400, 4800, 9600, 19200, 38400, 57600, 76800, 115200)
_OFFSETS = tuple(range(1220, 1227))
NUMBERS = frozenset(
    (
        *(*_LAW, *_AHEAD, 1820, 1825, 1826, 2005, 2068, 2092),
        *(0, 20, *_SERIAL.values(), 1004, 1013, 1020, *_OFFSETS),
        *(3401, 3402, 3403, *range(3410, 3433)),
        *(5003, 5004, 5114, 5115, 5400, 6001, *range(6050, 6060), *range(6071, 6090)),
    )
)
"""Parameters that are read here."""


def take_parameters(draft: Draft) -> None:
    """Read all program settings and motion data."""
    _axes(draft)
    _increments(draft)
    _words_and_arcs(draft)
    _cycles_and_offsets(draft)
    _work_offsets(draft)
    _calls(draft)
    _serial_line(draft)
    before = _limits_and_law(draft)
    _shaped_filter(draft)
    # 1604#0: look-ahead is on at cycle start. Shaped cuts switch it off and on again; the verdict covers it left on.
    if draft.choose("verdict.look_ahead", 1604, 0):
        draft.set("emission.prologue", ("G05.1Q0",), 1604)
        draft.set("emission.epilogue", ("G05.1Q1",), 1604)
    _corners_and_arcs(draft)
    _rapids(draft, before)
    _servo(draft)


def _limits_and_law(draft: Draft) -> bool:
    """Read axis limits and kind of acceleration; True for acceleration before interpolation."""
    acceleration = draft.per_axis(1660, unit="mm/s²")
    speed, time = draft.per_axis(1770, unit="mm/min"), draft.per_axis(1771, LONGEST_MS, "ms")
    filter_ms, bell_ms = draft.scalar(1769, LONGEST_MS, "ms"), draft.scalar(1772, LONGEST_MS, "ms")
    numbers: tuple[int, ...] = ()
    if acceleration and min(acceleration) > 0:
        numbers = (1660,)
    elif speed and time and min(*speed, *time) > 0:
        acceleration = [v / 60 / (t / 1000) for v, t in zip(speed, time, strict=True)]
        numbers = (1770, 1771)
    # The 16i family has 1770 and 1771 without 1769 or 1772.
    before = bool(numbers) and (numbers[0] == 1770 or filter_ms is not None or bell_ms is not None)
    if before:
        why = "the dump has acceleration before interpolation, but the program decides whether it is on (G05.1, G08)"
        if draft.bit(1604, 0):
            draft.set("controller.motion", "look_ahead", 1604, *numbers)
        else:
            draft.set("controller.motion", "look_ahead", *numbers, note=why)
        draft.set("controller.law", "jerk_limited", *numbers, note="constant acceleration before interpolation")
        if filter_ms is not None:
            _look_ahead_filter(draft, filter_ms / 1000)
        if bell_ms is not None:
            draft.set("controller.bell_time_s", bell_ms / 1000, 1772)
    _cutting_feeds(draft)
    if not before:
        _after_interpolation(draft)
    if numbers and acceleration:
        for k, name in enumerate("xyz"):
            axis = draft.axes[k]
            draft.set(f"axes.{name}.max_acceleration_mm_s2", acceleration[k], *numbers, axis=axis)
    return before


def _look_ahead_filter(draft: Draft, time_s: float) -> None:
    """Read 1769; a bell or exponential filter (1602#3, #6) becomes a moving average with the same radial error."""
    key = "controller.look_ahead_filter_time_constant_s"
    linear, bell = draft.bit(1602, 6), draft.bit(1602, 3)
    if linear is None or bell is None:
        draft.set(key, time_s, 1769, note="no 1602: linear after interpolation")
    elif bell:
        draft.set(key, time_s, 1769, 1602, note="bell, as a moving average of the same radial error")
    elif linear or not time_s:
        draft.set(key, time_s, 1769, 1602)
    else:
        average_s = round(time_s * math.sqrt(12.0), 6)
        note = f"exponential of {time_s * 1e3:g} ms, as a moving average of the same radial error"
        draft.set(key, average_s, 1769, 1602, note=note)


def _cutting_feeds(draft: Draft) -> None:
    """Set the maximum feeds: per axis the smallest of parameters 1422, 1430 (look-ahead off), 1432 (on)."""
    found = {n: draft.per_axis(n, unit="mm/min") for n in (1422, 1430, 1432)}
    for k, name in enumerate("xyz"):
        usable = {n: feeds[k] for n, feeds in found.items() if feeds and feeds[k] > 0}
        if usable:
            number = min(usable, key=lambda n: usable[n])
            key = f"axes.{name}.max_feed_mm_per_min"
            draft.set(key, usable[number], number, axis=draft.axes[k])
            others = [f"{n}: {feed:g}" for n, feed in usable.items() if n != number]
            if others:
                draft.remarks[key] += f", the smallest ({', '.join(others)})"


def _after_interpolation_s(draft: Draft) -> tuple[float, float, str, str] | None:
    """Filter by parameter 1622: time constant, second time constant, shape and note; None: not in the dump."""
    time = draft.scalar(1622, LONGEST_MS, "ms")
    if time is None:
        return None
    linear, bell = draft.bit(1610, 0), draft.bit(1610, 1)
    if bell:
        # Two moving averages of T/√2 have the variance T²/12 together, and so the radial error of the manual.
        part = time / 1000 / math.sqrt(2)
        return part, part, "linear", f"bell of {time:g} ms as two moving averages of T/√2"
    if linear is None:
        return time / 1000, 0.0, "linear", "kind of acceleration after interpolation not given (1610): linear"
    return time / 1000, 0.0, "linear" if linear else "exponential", ""


def _after_interpolation(draft: Draft) -> None:
    """Read the motion of a control without acceleration before interpolation."""
    found = _after_interpolation_s(draft)
    if found is None:
        draft.miss(1622, "no time constant of cutting feed; the kind of motion is unknown")
        return
    why = "no acceleration before interpolation in the dump"
    draft.set("controller.motion", "after_interpolation", 1622, note=why)
    _set_filter(draft, found, "time_constant_s", "bell_time_s", "after_interpolation_shape")
    lowest = draft.scalar(1623, unit="mm/min")
    if lowest:
        draft.miss(1623, f"lowest feed of exponential acceleration, {lowest:g} mm/min: read, but without a key")


def _shaped_filter(draft: Draft) -> None:
    """Set the filter of shaped blocks: with the look-ahead off, all cutting blocks pass that of 1622."""
    if found := _after_interpolation_s(draft):
        _set_filter(draft, found, "shaped_time_constant_s", "shaped_bell_time_s", "shaped_filter_shape")
    elif draft.get("controller.shaped_time_constant_s") is None:
        why = "no 1622: whether a filter after interpolation acts on shaped programs is not known"
        draft.assume_key("controller.shaped_time_constant_s", 0.0, why)


def _set_filter(draft: Draft, found: tuple[float, float, str, str], *names: str) -> None:
    *values, note = found
    for name, value in zip(names, values, strict=True):
        draft.set(f"controller.{name}", value, *((1622, 1610) if isinstance(value, float) else (1610,)), note=note)


def _corners_and_arcs(draft: Draft) -> None:
    steps = draft.per_axis(1783, unit="mm/min")
    if steps and min(steps) > 0:
        draft.set("controller.corner_speed_difference_mm_per_min", steps, 1783)
    elif steps:
        draft.miss(1783, "0: the behaviour of the controller is not known")
    across = [v for v in draft.per_axis(1735, unit="mm/s²") or [] if v > 0]
    feed, radius = draft.scalar(1730, unit="mm/min"), draft.scalar(1731, unit="µm")
    if across:
        draft.set("controller.centripetal_acceleration_mm_s2", min(across), 1735)
    elif feed and radius:
        draft.set("controller.centripetal_acceleration_mm_s2", (feed / 60) ** 2 / (radius / 1000), 1730, 1731)
    if draft.scalar(1732, unit="mm/min"):
        draft.miss(1732, "lowest feed of the clamp on arcs: read, but without a key")
    along = draft.per_axis(1737, unit="mm/s²")
    if along and min(along) > 0:
        draft.set("controller.contour_acceleration_mm_s2", along, 1737)


def _rapids(draft: Draft, before: bool) -> None:
    rates = draft.per_axis(1420, unit="mm/min", low=1e-3)
    for k, name in enumerate("xyz"):
        if rates:
            draft.set(f"axes.{name}.rapid_mm_per_min", rates[k], 1420, axis=draft.axes[k])
    look_ahead = before or draft.get("controller.motion") == "look_ahead"
    ahead = draft.per_axis(1773, LONGEST_MS, "ms") if look_ahead else None
    use_1773 = bool(ahead) and min(ahead or [0]) > 0
    times = ahead if use_1773 else draft.per_axis(1620, LONGEST_MS, "ms")
    if times:
        draft.set("controller.rapid_time_constant_s", [t / 1000 for t in times], 1773 if use_1773 else 1620)
    number = 1774 if use_1773 else 1621
    bell = draft.scalar(number, LONGEST_MS, "ms")
    if bell is not None:
        note = ""
        if number == 1621 and bell and draft.bit(1603, 6) is False:
            # Newer series have no RBL and take the bell from 1621 alone [general knowledge].
            note = "bell bit 1603#6 is 0; on this series " + ("1621 alone decides" if draft.dump.with_q else "off")
            bell = bell if draft.dump.with_q else 0.0
        draft.set("controller.rapid_bell_time_s", bell / 1000, number, note=note)
    draft.choose("controller.rapid_path", 1401, 1, "linear", "non_linear")


def _multiplier(code: float) -> float | None:
    """Command multiplier (CMR) from 1820, which is twice the CMR, or 100 + n for a CMR of 1/n; None: invalid."""
    if 101 <= code <= 127:
        return 1.0 / (code - 100)
    return code / 2.0 if 1 <= code <= 96 else None


def _servo(draft: Draft) -> None:
    gains = draft.per_axis(1825, unit="0.01/s", low=1)
    if gains:
        draft.set("controller.position_gain_per_s", [g * 0.01 for g in gains], 1825)
    widths = draft.per_axis(1826, unit="detection units")
    if widths and min(widths) > 0:
        codes = draft.per_axis(1820, 1000)
        multipliers = [_multiplier(code) for code in codes or ()]
        step_um, known = increment_um(draft)
        if len(multipliers) == 3 and all(multipliers):
            units = [step_um / each for each in multipliers if each]
            note = "" if known else f"least increment {step_um:g} µm (no 1013)"
            numbers: tuple[int, ...] = (1826, 1820, 1013) if known else (1826, 1820)
        else:
            units, numbers, note = [1.0] * 3, (1826,), "detection unit 1 µm assumed (no command multiplier 1820)"
        um = [round(width * unit, 9) for width, unit in zip(widths, units, strict=True)]
        draft.set("controller.in_position_width_um", um, *numbers, note=note)
    on = [draft.dump.get(2005, axis) for axis in draft.axes]
    if all(on):
        fine, coarse = draft.per_axis(2092, 10_000, "0.01 %"), draft.per_axis(2068, 100, "%")
        ratios = [0.0, 0.0, 0.0]
        for k, entry in enumerate(on):
            if entry is not None and draft.bit_of(entry, 1):
                ratios[k] = fine[k] / 1e4 if fine and fine[k] else (coarse[k] / 100 if coarse else 0.0)
        draft.set("controller.feed_forward_ratio", ratios, 2005, 2092 if fine else 2068)


_KEYS = {10: "tool_length_mm", 11: "tool_length_wear_mm", 12: "tool_radius_mm", 13: "tool_radius_wear_mm"}


def take_tables(draft: Draft, tables: ControlTables) -> None:
    """Read offsets and variables, as of the time of punching."""
    _tools(draft, tables)
    _systems(draft, tables)
    if tables.variables:
        given = {str(n): value for n, value in sorted(tables.variables.items()) if value is not None}
        _put(draft, tables, "variables", "input.variables", given, len(given))
    for file, line, words in tables.left_out:
        draft.miss("", f'{file}: "{words}": read, but not used', line)


def _tools(draft: Draft, tables: ControlTables) -> None:
    if not tables.tools:
        return
    # Memory A: one value; B: geometry and wear; C: geometry and wear, separately for length and radius.
    memory = "C" if tables.kinds & {12, 13} else "B" if tables.kinds & {10, 11} else "A"
    _put(draft, tables, "tools", "controller.offset_memory", memory, 1)
    halved = 2.0 if draft.bit(5004, 2) else 1.0
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
        draft.miss("", f"{file}: {total - len(filled)} of {total} tool offsets are all zero: left out", last)
    if halved == 2.0:
        draft.assume("input.tool_radius_mm", "halved", "5004#2: cutter compensation is set as a diameter")


def _mm(draft: Draft, value: float, point: bool) -> float:
    """Convert a table value to mm: with a point it is in mm or inch (0000#2), without one in least increments."""
    if not point:
        return value * (increment_um(draft)[0] / 1000)
    return value * (MM_PER_INCH if draft.bit(0, 2) else 1.0)


def _systems(draft: Draft, tables: ControlTables) -> None:
    if not tables.systems:
        return
    rows = {name: [_mm(draft, *axes.get(axis, (0.0, True))) for axis in "XYZ"] for name, axes in tables.systems.items()}
    shift = rows.pop("", [0.0, 0.0, 0.0])
    offsets = shifted(rows, shift)
    _put(draft, tables, "systems", "input.work_offsets", offsets, len(offsets))


def _put(draft: Draft, tables: ControlTables, group: str, key: str, value: object, count: int) -> None:
    file, first, last = tables.sources[group]
    draft.put(key, value)
    draft.remarks[key] = f"FANUC {file}: state at the time of punching"
    draft.tables.append(ReadTable(file, first, last, key, count))


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
    draft.axes = (names[88], names[89], names[90])


def increment_um(draft: Draft) -> tuple[float, bool]:
    """Least increment of a metric axis, µm (bit 1: IS-C, bit 0: IS-A, neither: IS-B), and whether it is in the dump."""
    number = _increment_parameter(draft)
    if number is None:
        return 1.0, False
    fine, coarse = draft.bit(number, 1), draft.bit(number, 0)
    return (0.1 if fine else 10.0 if coarse else 1.0), True


def _increment_parameter(draft: Draft) -> int | None:
    """Number of the parameter with the increment bits: 1013 per axis; in older series 1004 for all."""
    return next((n for n in (1013, 1004) if draft.bit(n, 1) is not None), None)


def _increments(draft: Draft) -> None:
    number = _increment_parameter(draft)
    if number is None:
        draft.miss(1013, "no increment system: IS-B is assumed, least increment 0.001 mm")
        return
    step_um, _ = increment_um(draft)
    steps = {draft.bit_of(entry, 1) for entry in draft.entries(number)}
    if len(steps) > 1:
        draft.assume(f"parameter {number}", "differs", "increment systems differ between the axes; that of X counts")
    draft.set("controller.least_increment_mm", round(step_um / 1000, 9), number)
    draft.set("controller.least_increment_inch", round(step_um / 10_000, 9), number)


def _words_and_arcs(draft: Draft) -> None:
    draft.choose("controller.calculator_decimal_point", 3401, 0)
    draft.choose("input.arc_without_centre", 3403, 5, "alarm", "line")
    entry = draft.dump.get(3410)
    if entry and (tolerance := _length_mm(draft, 3410)):
        note = "" if "." in entry.text else "whole number: in least increments"
        draft.set("controller.arc_radius_tolerance_mm", tolerance, 3410, note=note)
    elif entry:
        draft.miss(3410, "0: means no check on some series; not known here", entry.line)
    if draft.choose("power_on.motion", 3402, 0, "G01", "G00") is not None:
        draft.choose("power_on.plane", 3402, 2, "G19", "G18" if draft.bit(3402, 1) else "G17")
        draft.choose("power_on.distance", 3402, 3, "G91", "G90")
    draft.choose("power_on.units", 0, 2, "G20", "G21")
    codes = {n: draft.scalar(n, 99_999_999) for n in range(3411, 3433)}
    given = {n: int(code) for n, code in codes.items() if code}
    if given:
        draft.set("controller.no_buffer_m_codes", tuple(sorted(set(given.values()))), *given)


def _length_mm(draft: Draft, number: int) -> float | None:
    """Read a length without axes: with a point in mm or inch, without one in least increments."""
    value = draft.scalar(number, unit="mm")
    if value is None:
        return None
    entry = draft.dump.get(number) or draft.entries(number)[0]
    return value if "." in entry.text else round(value * increment_um(draft)[0] / 1000, 9)


def _cycles_and_offsets(draft: Draft) -> None:
    draft.choose("input.scale_unit", 5400, 7, 0.001, 0.00001)
    clearances = {n: _length_mm(draft, n) for n in (5114, 5115)}
    given = {n: mm for n, mm in clearances.items() if mm is not None}
    if given:
        largest = max(given.values())
        note = "" if min(given.values()) == largest else "G73 and G83 differ; the larger one counts for both"
        draft.set("input.peck_clearance_mm", largest, *given, note=note)
    if draft.bit(5003, 1):
        draft.miss(5003, "start-up of cutter compensation of type C: read, but not supported; type A or B is used")
    else:
        draft.choose("input.compensation_start_up", 5003, 0, "B", "A")


def _work_offsets(draft: Draft) -> None:
    """Read 1221 to 1226 (G54 to G59), each with 1220 added."""
    step_mm = increment_um(draft)[0] / 1000
    found: dict[int, list[float]] = {}
    for number in _OFFSETS:
        entries = draft.entries(number)
        if len(entries) == 3:
            mm = draft.per_axis(number, unit="mm", low=-1e7) or []
            found[number] = [v if "." in e.text else v * step_mm for v, e in zip(mm, entries, strict=True)]
    shift = found.pop(1220, [0.0, 0.0, 0.0])
    if found:
        used = [number for number in _OFFSETS if number in found] + ([1220] if any(shift) else [])
        offsets = shifted({f"G{number - 1167}": each for number, each in found.items()}, shift)
        draft.set("input.work_offsets", offsets, *used)


def shifted(offsets: Mapping[str, Sequence[float]], shift: Sequence[float]) -> dict[str, tuple[float, ...]]:
    """Add the common shift to the work offsets, and leave out sums that are zero."""
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
        codes = {n: draft.scalar(n, 99_999_999, low=-9999) for n in numbers}
        given = {n: int(code) for n, code in codes.items() if code and code > 0}
        for n in (n for n, code in codes.items() if code and code < 0):
            draft.miss(n, "a code that calls a macro in every block (negative): read, but not used")
        if any(code is not None for code in codes.values()):
            draft.set(key, {str(code): first + n - numbers[0] for n, code in given.items()}, *(given or codes))
    draft.choose("input.tool_program", 6001, 5, 9000, 0)


def _serial_line(draft: Draft) -> None:
    """Read the baud rate of the I/O channel in 0020; without 0020 drip feed is not assumed."""
    channel = draft.scalar(20, 35)
    if channel is None:
        if draft.scalar(103) is not None:
            draft.miss(103, "no 0020: input channel not known; drip feed not assumed")
        return
    number = _SERIAL.get(int(channel))
    if number is None:
        draft.set("controller.dnc_baud", 0, 20)
        return
    speed = draft.scalar(number, 1000)
    if speed is None:
        draft.miss(number, f"transfer speed of channel {channel:g} (0020) is not in the dump")
    elif not speed < len(_BAUD):
        draft.miss(number, f"{speed:g}: not a code of a transfer speed (0 to {len(_BAUD) - 1})")
    elif speed:
        draft.set("controller.dnc_baud", _BAUD[int(speed)], 20, number)
