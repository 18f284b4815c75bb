"""A controller's parameter dump as a machine.

:func:`import_parameters` takes from a dump what it says about the motion, and from a base machine what it does not
say (the vibration modes, above all). Every value carries the parameter it comes from. See docs/parameters.md.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from pathlib import Path
from typing import Any

from shapegcode.errors import MachineError, Problem
from shapegcode.machine.fanuc_dump import Dump, read_dump
from shapegcode.machine.fanuc_values import LONGEST_MS, DumpValues
from shapegcode.machine.machine import Machine
from shapegcode.machine.result import AssumedValue, MissingParameter, ParameterImport, ReadParameter, Value
from shapegcode.results.result import Xyz

__all__ = ["import_parameters"]

_MOTION = (1401, 1420, 1422, 1430, 1432, 1603, 1610, 1620, 1621, 1622, 1623, 1660, 1730, 1731, 1732, 1735, 1737)
_AHEAD = (1769, 1770, 1771, 1772, 1773, 1774, 1783)
_WANTED = frozenset((103, 1020, *_MOTION, *_AHEAD, 1825, 1826, 2005, 2068, 2092, 3401, 3402, *range(3410, 3433)))
_BAUD = (0, 50, 100, 110, 150, 200, 300, 600, 1200, 2400, 4800, 9600, 19200, 38400, 57600, 76800, 115200)


def import_parameters(
    dump: str | Path | bytes, base: Machine | None = None, *, source: str = "<dump>"
) -> ParameterImport:
    """The machine that a control's parameter dump describes (CNC-PARA.TXT).

    Args:
        dump: the file, or its content.
        base: machine for what the dump does not say; None: the defaults of the machine file.
        source: names the content in messages.

    Returns:
        The machine, and what was read, assumed and missing.

    Raises:
        MachineError: no dump, a value that is not plausible, or a limit of an axis that neither dump nor base has.
        OSError: the file cannot be read.
    """
    data, name = (dump, source) if isinstance(dump, bytes) else (Path(dump).read_bytes(), str(dump))
    return _Importer(read_dump(data, name, _WANTED), base).run()


class _Importer:
    def __init__(self, dump: Dump, base: Machine | None) -> None:
        self._dump = dump
        self._values = DumpValues(dump)
        self._base = base
        name = "".join(c for c in Path(dump.file).stem if " " <= c <= "~")[:60]
        self._data: dict[str, Any] = (
            base.model_dump(mode="python", exclude_unset=True) if base else {"name": name or "machine"}
        )
        self._read: list[ReadParameter] = []
        self._assumed: list[AssumedValue] = []
        self._missing: list[MissingParameter] = []
        self._remarks: dict[str, str] = {}

    def run(self) -> ParameterImport:
        self._find_axes()
        self._limits_and_law()
        self._corners_and_arcs()
        self._rapids()
        self._servo()
        self._program()
        for number, line in self._dump.repeated:
            self._miss(number, "given again (another path): the first one counts", line)
        for line, text in self._dump.strange:
            self._miss("", f'not understood: "{text}"', line)
        held = {number for number, _ in self._dump.entries}
        for number in (1401, 1420, 1430, 1620, 1622, 1660, 1735, 1783, 1825, 1826, 3401, 3402, 3410):
            if number not in held:
                self._miss(number, "not in the dump")
        if not self._dump.complete:
            self._miss("", "no % at the end: the dump may be cut")
        if self._values.problems:
            raise MachineError(self._dump.file, tuple(self._values.problems))
        self._require_limits()
        machine = Machine.from_data(self._data, self._dump.file)
        for value in machine.values():
            if value.key not in self._remarks and value.assumed:
                self._remarks[value.key] = "assumed: not in the dump"
                self._assume(value.key, value.value, "default of the machine file")
            elif value.key not in self._remarks and self._base and value.origin == "file":
                self._remarks[value.key] = f"from {self._base.name}"
        for number, largest in dict(self._values.differing).items():
            self._assume(f"parameter {number}", largest, "differs between the axes; the largest counts")
        return ParameterImport(
            self._dump.file, machine, tuple(self._read), tuple(self._assumed), tuple(self._missing), self._remarks
        )

    # Results.

    def _miss(self, number: int | str, why: str, line: int | None = None) -> None:
        self._missing.append(MissingParameter(str(number), line, why))

    def _assume(self, key: str, value: Value, why: str) -> None:
        self._assumed.append(AssumedValue(key, value, why))

    def _set(self, key: str, value: Any, *numbers: int, note: str = "", axis: int | None = None) -> None:
        """Put a value into the machine, and its origin into the list and the remark."""
        *tables, name = key.split(".")
        table = self._data
        for part in tables:
            table = table.setdefault(part, {})
        if isinstance(value, list):
            table[name] = dict(zip("xyz", value, strict=True))
            value = Xyz(*value)
        else:
            table[name] = value
        origin = "FANUC " + ", ".join(str(number) for number in numbers)
        self._remarks[key] = f"{origin}: {note}" if note else origin
        if note:
            self._assume(key, value, note)
        for number in numbers:
            axes = self._values.axes if axis is None else (axis,)
            entries = [entry for a in axes if (entry := self._dump.get(number, a))]
            path = self._dump.get(number)
            for entry in entries or ([path] if path else []):
                raw = entry.letter + entry.text
                self._read.append(ReadParameter(number, entry.target, raw, entry.line, key, value))

    # The machine, part by part.

    def _find_axes(self) -> None:
        names = {
            float(entry.text): int(entry.target[1:])
            for (number, target), entry in self._dump.entries.items()
            if number == 1020 and target.startswith("A")
        }
        if not names:
            self._assume("axes", "A1, A2, A3", "no axis names (1020): A1 is X, A2 is Y, A3 is Z")
            return
        absent = [chr(code) for code in (88, 89, 90) if code not in names]
        if absent:
            line = next(e.line for (n, _), e in self._dump.entries.items() if n == 1020)
            self._values.problems.append(Problem("parameter 1020", "", f"no axis is named {', '.join(absent)}", line))
            return
        self._values.axes = (names[88], names[89], names[90])

    def _limits_and_law(self) -> None:
        acceleration = self._values.per_axis(1660, unit="mm/s²")
        speed, time = self._values.per_axis(1770, unit="mm/min"), self._values.per_axis(1771, LONGEST_MS, "ms")
        filter_ms, bell_ms = self._values.scalar(1769, LONGEST_MS, "ms"), self._values.scalar(1772, LONGEST_MS, "ms")
        numbers: tuple[int, ...] = ()
        if acceleration and min(acceleration) > 0:
            numbers = (1660,)
        elif speed and time and min(*speed, *time) > 0:
            acceleration = [v / 60 / (t / 1000) for v, t in zip(speed, time, strict=True)]
            numbers = (1770, 1771)
        # The 16i family has no 1769 or 1772 beside 1770, 1771.
        before = bool(numbers) and (numbers[0] == 1770 or filter_ms is not None or bell_ms is not None)
        if before:
            why = "the program decides (G05.1 Q1, G08 P1); the dump has acceleration before interpolation"
            self._set("controller.motion", "look_ahead", *numbers, note=why)
            self._set("controller.law", "jerk_limited", *numbers, note="constant acceleration before interpolation")
            if filter_ms is not None:
                self._set("controller.look_ahead_filter_time_constant_s", filter_ms / 1000, 1769)
            if bell_ms is not None:
                self._set("controller.bell_time_s", bell_ms / 1000, 1772)
        self._cutting_feeds(before)
        self._after_interpolation(before)
        if numbers and acceleration:
            for k, name in enumerate("xyz"):
                self._set(f"axes.{name}.max_acceleration_mm_s2", acceleration[k], *numbers, axis=self._values.axes[k])

    def _cutting_feeds(self, before: bool) -> None:
        found = {n: self._values.per_axis(n, unit="mm/min") for n in (1422, 1430, 1432)}
        for k, name in enumerate("xyz"):
            usable = {n: values[k] for n, values in found.items() if values and values[k] > 0}
            per_axis = 1432 if before and 1432 in usable else 1430
            usable.pop(1430 if per_axis == 1432 else 1432, None)
            if usable:
                number = min(usable, key=lambda n: usable[n])
                self._set(f"axes.{name}.max_feed_mm_per_min", usable[number], number, axis=self._values.axes[k])

    def _after_interpolation(self, before: bool) -> None:
        time = self._values.scalar(1622, LONGEST_MS, "ms")
        if before or time is None:
            if not before:
                self._miss(1622, "no time constant of cutting feed; the kind of motion cannot be known")
            return
        self._set("controller.motion", "after_interpolation", 1622, note="no acceleration before interpolation in dump")
        linear, bell = self._values.bit(1610, 0), self._values.bit(1610, 1)
        if bell:
            # Two moving averages a = b = T/√2 have the variance T²/12 of the manual's radial error.
            part = time / 1000 / math.sqrt(2)
            note = f"bell of {time:g} ms as two moving averages of T/√2"
            self._set("controller.time_constant_s", part, 1622, 1610, note=note)
            self._set("controller.bell_time_s", part, 1622, 1610, note=note)
        else:
            self._set("controller.time_constant_s", time / 1000, 1622)
            self._set("controller.bell_time_s", 0.0, 1622)
        if linear is None:
            self._miss(1610, "kind of acceleration after interpolation not given")
        else:
            shape = "linear" if linear or bell else "exponential"
            self._set("controller.after_interpolation_shape", shape, 1610)
        lowest = self._values.scalar(1623, unit="mm/min")
        if lowest:
            self._miss(1623, f"lowest feed of exponential acceleration, {lowest:g} mm/min: no key")

    def _corners_and_arcs(self) -> None:
        steps = self._values.per_axis(1783, unit="mm/min")
        if steps and min(steps) > 0:
            self._set("controller.corner_speed_difference_mm_per_min", steps, 1783)
        elif steps:
            self._miss(1783, "0: what the controller does then is not known")
        across = [v for v in self._values.per_axis(1735, unit="mm/s²") or [] if v > 0]
        feed, radius = self._values.scalar(1730, unit="mm/min"), self._values.scalar(1731, unit="µm")
        if across:
            self._set("controller.centripetal_acceleration_mm_s2", min(across), 1735)
        elif feed and radius:
            self._set("controller.centripetal_acceleration_mm_s2", (feed / 60) ** 2 / (radius / 1000), 1730, 1731)
        if self._values.scalar(1732, unit="mm/min"):
            self._miss(1732, "lowest feed of the clamp on arcs: no key")
        along = self._values.per_axis(1737, unit="mm/s²")
        if along and min(along) > 0:
            self._set("controller.contour_acceleration_mm_s2", along, 1737)

    def _rapids(self) -> None:
        rates = self._values.per_axis(1420, unit="mm/min", low=1e-3)
        for k, name in enumerate("xyz"):
            if rates:
                self._set(f"axes.{name}.rapid_mm_per_min", rates[k], 1420, axis=self._values.axes[k])
        look_ahead = self._data.get("controller", {}).get("motion") == "look_ahead"
        ahead = self._values.per_axis(1773, LONGEST_MS, "ms") if look_ahead else None
        use_1773 = bool(ahead) and min(ahead or [0]) > 0
        times = ahead if use_1773 else self._values.per_axis(1620, LONGEST_MS, "ms")
        if times:
            self._set("controller.rapid_time_constant_s", [t / 1000 for t in times], 1773 if use_1773 else 1620)
        number = 1774 if use_1773 else 1621
        bell = self._values.scalar(number, LONGEST_MS, "ms")
        if bell is not None:
            note = ""
            if number == 1621 and bell and self._values.bit(1603, 6) is False:
                # Newer series have no RBL and take the bell from 1621 alone [general knowledge].
                note = "bell bit 1603#6 is 0; on this series " + ("1621 alone decides" if self._dump.with_q else "off")
                bell = bell if self._dump.with_q else 0.0
            self._set("controller.rapid_bell_time_s", bell / 1000, number, note=note)
        linear = self._values.bit(1401, 1)
        if linear is not None:
            self._set("controller.rapid_path", "linear" if linear else "non_linear", 1401)

    def _servo(self) -> None:
        gains = self._values.per_axis(1825, unit="0.01/s", low=1)
        if gains:
            self._set("controller.position_gain_per_s", [g * 0.01 for g in gains], 1825)
        widths = self._values.per_axis(1826, unit="detection units")
        if widths and min(widths) > 0:
            self._set("controller.in_position_width_um", widths, 1826, note="detection unit 1 µm assumed")
        on = [self._dump.get(2005, axis) for axis in self._values.axes]
        if all(on):
            fine, coarse = self._values.per_axis(2092, 10_000, "0.01 %"), self._values.per_axis(2068, 100, "%")
            ratios = [0.0, 0.0, 0.0]
            for k, entry in enumerate(on):
                if entry is not None and self._values.bit_of(entry, 1):
                    ratios[k] = fine[k] / 1e4 if fine and fine[k] else (coarse[k] / 100 if coarse else 0.0)
            self._set("controller.feed_forward_ratio", ratios, 2005, 2092 if fine else 2068)

    def _program(self) -> None:
        point = self._values.bit(3401, 0)
        if point is not None:
            self._set("controller.calculator_decimal_point", point, 3401)
        entry = self._dump.get(3410)
        tolerance = self._values.scalar(3410, unit="mm")
        if entry and tolerance:
            whole = "." not in entry.text
            note = "whole number: in 0.001 mm" if whole else ""
            self._set("controller.arc_radius_tolerance_mm", tolerance / (1000 if whole else 1), 3410, note=note)
        elif entry:
            self._miss(3410, "0: taken by some series as no check; not known", entry.line)
        choices: tuple[tuple[str, Callable[[], str]], ...] = (
            ("motion", lambda: "G01" if self._values.bit(3402, 0) else "G00"),
            ("plane", lambda: "G19" if self._values.bit(3402, 2) else "G18" if self._values.bit(3402, 1) else "G17"),
            ("distance", lambda: "G91" if self._values.bit(3402, 3) else "G90"),
        )
        if self._values.bit(3402, 0) is not None:
            for name, choose in choices:
                self._set(f"power_on.{name}", choose(), 3402)
        speed = self._values.scalar(103, len(_BAUD) - 1)
        if speed is not None and not 0 <= speed < len(_BAUD):
            self._miss(103, f"{speed:g}: no transfer speed has this code (0 to {len(_BAUD) - 1})")
        elif speed:
            self._set("controller.dnc_baud", _BAUD[int(speed)], 103)
        codes = {n: self._values.scalar(n, 99_999_999) for n in range(3411, 3433)}
        given = {n: int(code) for n, code in codes.items() if code}
        if given:
            self._set("controller.no_buffer_m_codes", tuple(sorted(set(given.values()))), *given)

    def _assume_limits(self) -> None:
        """Acceleration and feed limits that a control without them keeps by its time constants."""
        ramp_s = self._data.get("controller", {}).get("time_constant_s")
        for axis in "xyz":
            table = self._data.get("axes", {}).get(axis, {})
            rapid = table.get("rapid_mm_per_min")
            if rapid and "max_feed_mm_per_min" not in table:
                table["max_feed_mm_per_min"] = rapid
                self._note(f"axes.{axis}.max_feed_mm_per_min", rapid, "no 1422 or 1430: the rapid rate")
            feed = table.get("max_feed_mm_per_min")
            if feed and ramp_s and "max_acceleration_mm_s2" not in table:
                acceleration = round(feed / 60.0 / ramp_s, 3)
                table["max_acceleration_mm_s2"] = acceleration
                why = "no 1660: what the largest cutting feed asks for within the time constant after interpolation"
                self._note(f"axes.{axis}.max_acceleration_mm_s2", acceleration, why)

    def _note(self, key: str, value: float, why: str) -> None:
        self._remarks[key] = f"assumed: {why}"
        self._assume(key, value, why)

    def _require_limits(self) -> None:
        self._assume_limits()
        needed = {"max_feed_mm_per_min": "1430", "rapid_mm_per_min": "1420", "max_acceleration_mm_s2": "1660"}
        problems = [
            Problem(f"axes.{axis}.{name}", "", f"not in the dump (parameter {number}); --from MACHINE gives it")
            for axis in "xyz"
            for name, number in needed.items()
            if name not in self._data.get("axes", {}).get(axis, {})
        ]
        if problems:
            raise MachineError(self._dump.file, tuple(problems))
