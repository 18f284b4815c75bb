"""A control of its own that runs a program and keeps a log: what `characterize --runs` must find out again.

Shares no code with the package: lines only, a trapezoidal planner with a largest speed step of each axis at corners,
rapids with a time constant, M codes, a spindle that starts beside the moves, a tool change, an operator at the dial.
"""

from __future__ import annotations

import bisect
import math
import random
from collections.abc import Callable
from dataclasses import dataclass, field


@dataclass
class HiddenControl:
    """The facts."""

    acceleration: float = 700.0
    corner_step: float = 6.0  # mm/s of an axis
    rapid: float = 300.0
    rapid_time: float = 0.12
    arrival: float = 0.05
    tool_change: float = 4.2
    m_codes: dict[int, float] = field(default_factory=lambda: {3: 0.2, 5: 0.1, 8: 1.5, 9: 0.3, 30: 2.0})
    spindle_per_krpm: float = 0.25
    way: float = 0.9  # of an axis from a place that is not known
    start: float = 1.3
    poll: float = 0.13
    feed_factor: float = 60.0  # shown feed over mm/s
    override: float = 1.0
    block_time: float = 0.0  # no block of a cut is run off faster
    operator: float = 0.0  # scatter of a tool change, s

    def run(self, text: str, seed: int = 0) -> tuple[str, float, dict[int, float]]:
        """Log text, duration in s, and when each line begins."""
        generator = random.Random(seed)
        events = self._events(text, random.Random(seed + 1))
        end = events[-1][0]
        times = [event[0] for event in events]
        rows = ["2026-03-02T08:00:00.0000Z|Program_Status|ACTIVE"]
        at, shown = generator.random() * self.poll, (None, None)
        while at < end:
            # Before the first block a control still shows where the run before ended: the last event.
            _, line, speed = events[bisect.bisect_right(times, at) - 1]
            if callable(speed):
                speed = speed(at)
            now = (line, round(speed * self.feed_factor, 1))
            for name, old, new in zip(("Block_Number", "Feed_Rate"), shown, now, strict=True):
                if new != old:
                    rows.append(f"{_stamp(at)}|{name}|{new}")
            shown = now
            at += self.poll
        rows.append(f"{_stamp(end)}|Program_Status|PROGRAM_COMPLETED")
        return "\n".join(rows) + "\n", end, {line: begin for begin, line, _ in reversed(events)}

    def _events(self, text: str, generator: random.Random) -> list[tuple[float, int, object]]:
        """(time, line, feed or feed as a function of time)."""
        events: list[tuple[float, int, object]] = []
        now, position, known = self.start, [0.0, 0.0, 0.0], [False, False, False]
        motion, feed, ready, stopped = 0, 0.0, 0.0, 0.0
        run: list[tuple[int, list[float], float]] = []  # line, way, feed

        def close() -> None:
            nonlocal now
            if run:
                for line, begin, speed in self._plan(run):
                    events.append((now + begin, line, speed))
                now += self._plan_time
                run.clear()

        for number, block in enumerate(text.splitlines(), start=1):
            words = _words(block)
            codes = [int(value) for letter, value in words if letter == "G"]
            m_codes = [int(value) for letter, value in words if letter == "M"]
            places = {letter: value for letter, value in words if letter in "XYZFS"}
            motion = next((code for code in codes if code in (0, 1)), motion)
            feed = places.get("F", feed)
            axes = [axis for axis in "XYZ" if axis in places]
            if m_codes or (axes and motion == 0) or 28 in codes:
                close()
            if not (axes and motion == 1):
                events.append((now, number, 0.0))
            for code in m_codes:
                if code in (6, 30):
                    now = max(now, stopped)
                if code == 3:
                    ready = now + self.spindle_per_krpm * places.get("S", 0.0) / 1000.0
                elif code == 5:
                    stopped = now + 1.0
                else:
                    now = max(now, ready)
                now += self.tool_change if code == 6 else self.m_codes.get(code, 0.0)
                now += abs(generator.gauss(0.0, self.operator)) if code == 6 and self.operator else 0.0
                if code == 6:
                    known = [False, False, False]
            if 28 in codes:
                now += self.way
                known[2] = False
                continue
            if not axes:
                continue
            target = [places.get(axis, position[index]) for index, axis in enumerate("XYZ")]
            way = [new - old for new, old in zip(target, position, strict=True)]
            if motion == 0:
                events[-1] = (now, number, self._rapid_feed(way, now))
                if all(known["XYZ".index(axis)] for axis in axes):
                    now += self._rapid(way)
                else:
                    now += self.way
            else:
                if not run:
                    now = max(now, ready)
                run.append((number, way, feed / 60.0 * self.override))
            position = target
            for axis in axes:
                known["XYZ".index(axis)] = True
        close()
        events.append((now, number, 0.0))
        return events

    def _rapid(self, way: list[float]) -> float:
        """Straight; the axis that needs longest; ramps of the time constant."""
        longest = max(abs(each) for each in way)
        ramp = self.rapid / self.rapid_time
        if longest <= 0.0:
            return 0.0
        short = longest < self.rapid * self.rapid_time
        return (2.0 * math.sqrt(longest / ramp) if short else longest / self.rapid + self.rapid_time) + self.arrival

    def _rapid_feed(self, way: list[float], begin: float) -> Callable[[float], float]:
        """Speed along the way over time."""
        longest = max(abs(each) for each in way)
        ramp, took = self.rapid / self.rapid_time, self._rapid(way) - self.arrival
        ratio = math.sqrt(sum(each * each for each in way)) / longest if longest > 0.0 else 0.0
        return lambda at: ratio * max(0.0, min(self.rapid, ramp * (at - begin), ramp * (begin + took - at)))

    def _plan(self, run: list[tuple[int, list[float], float]]) -> list[tuple[int, float, object]]:
        """Forward and backward over v²; (line, begin, feed in the middle)."""
        lengths = [math.sqrt(sum(each * each for each in way)) for _, way, _ in run]
        units = [[each / length for each in way] for (_, way, _), length in zip(run, lengths, strict=True)]
        accelerations = [self.acceleration / max(abs(each) for each in unit) for unit in units]
        border = [0.0]
        for index in range(1, len(run)):
            before, after, one, other = units[index - 1], units[index], run[index - 1][2], run[index][2]
            step = max(abs(new - old) for new, old in zip(after, before, strict=True))
            border.append(min(one, other, self.corner_step / step if step > 1e-9 else math.inf))
        border.append(0.0)
        for index, length in enumerate(lengths):
            border[index + 1] = min(
                border[index + 1], math.sqrt(border[index] ** 2 + 2 * accelerations[index] * length)
            )
        for index in reversed(range(len(lengths))):
            reach = math.sqrt(border[index + 1] ** 2 + 2 * accelerations[index] * lengths[index])
            border[index] = min(border[index], reach)
        rows, now = [], 0.0
        for index, (line, _, feed) in enumerate(run):
            low, high, a = border[index], border[index + 1], accelerations[index]
            peak = min(feed, math.sqrt(a * lengths[index] + 0.5 * (low * low + high * high)))
            ramps = (peak * peak - low * low + peak * peak - high * high) / (2.0 * a)
            rows.append((line, now, peak))
            took = (2.0 * peak - low - high) / a + max(0.0, lengths[index] - ramps) / peak
            now += max(took, self.block_time)
        self._plan_time = now
        return rows


def _words(block: str) -> list[tuple[str, float]]:
    found, letter, number = [], "", ""
    for sign in block.split("(", maxsplit=1)[0] + " ":
        if sign.isalpha() or sign == " ":
            if letter and number:
                found.append((letter, float(number)))
            letter, number = sign if sign.isalpha() else "", ""
        else:
            number += sign
    return found


def _stamp(seconds: float) -> str:
    whole = int(seconds)
    return f"2026-03-02T{8 + whole // 3600:02d}:{whole // 60 % 60:02d}:{whole % 60:02d}.{int((seconds % 1) * 1e4):04d}Z"


def written_program(seed: int, tools: int = 2, feeds: tuple[float, ...] = (600.0, 1500.0)) -> str:
    """A program of pockets in zigzag and of polygons, with tool changes."""
    generator = random.Random(seed)
    lines = ["%", f"O{1000 + seed}", "G21 G90 G94 G17 G40 G80"]
    for tool in range(1, tools + 1):
        lines += [f"T{tool} M6", f"G0 X0. Y0. S{generator.choice((4000, 8000))} M3", "Z10. M8", "X250.", "X0."]
        for _ in range(6):
            x, y, feed = generator.uniform(0, 100), generator.uniform(0, 80), generator.choice(feeds)
            lines += [f"G0 X{x:.3f} Y{y:.3f}", "Z2.", f"G1 Z-1. F{feed / 2:.0f}"]
            lines.append(f"G1 X{x + 1:.3f} F{feed:.0f}")
            if generator.random() < 0.5:
                for row in range(12):
                    lines += [f"X{x + (20 if row % 2 == 0 else 0) + 1:.3f}", f"Y{y + row + 1:.3f}"]
            else:
                radius, corners = generator.uniform(2, 9), generator.choice((6, 36, 90))
                for corner in range(3 * corners):
                    angle = 2 * math.pi * corner / corners
                    lines.append(f"X{x + radius * math.cos(angle):.4f} Y{y + radius * math.sin(angle):.4f}")
            lines.append("G0 Z10.")
        lines += ["M5", "G91 G28 Z0. M9", "G90"]
    return "\n".join([*lines, "M30", "%"]) + "\n"


def drawn_control(seed: int) -> HiddenControl:
    """A control with drawn facts: no bell, unlike what is fitted, and a block time that some of it does not have."""
    generator = random.Random(seed)

    def near(usual: float, times: float) -> float:
        """Even in the logarithm, from usual / times to usual * times."""
        return usual * times ** generator.uniform(-1.0, 1.0)

    return HiddenControl(
        acceleration=near(1000.0, 3.0), corner_step=near(7.0, 3.0), rapid=near(350.0, 1.6), rapid_time=near(0.12, 1.6),
        arrival=near(0.04, 2.0), tool_change=near(5.0, 1.6), spindle_per_krpm=near(0.25, 2.0), way=near(0.9, 1.5),
        m_codes={code: generator.uniform(0.0, 2.0) for code in (3, 5, 8, 9, 30)}, start=near(1.3, 2.0),
        block_time=generator.uniform(0.0, 0.006), operator=0.1,
    )  # fmt: skip


def surface_program(seed: int, rows: int = 9) -> str:
    """Rows over a wavy surface in moves of .2 to .6 mm, as CAM systems write them."""
    generator = random.Random(seed)
    step, height, wave = generator.uniform(0.2, 0.6), generator.uniform(0.5, 2.0), generator.uniform(6.0, 20.0)
    feed = generator.choice((1500.0, 2500.0))
    lines = ["%", f"O{2000 + seed}", "G21 G90 G94 G17 G40 G80", "T1 M6", "G0 X0. Y0. S8000 M3", "Z10. M8", "Z2."]
    lines.append(f"G1 Z-1. F{feed / 2:.0f}")
    count = int(60.0 / step)
    for row in range(rows):
        lines.append(f"G1 Y{0.5 * (row + 1):.3f} F{feed:.0f}")
        for index in range(1, count + 1):
            x = step * (index if row % 2 == 0 else count - index)
            z = height * math.sin(2.0 * math.pi * x / wave) * math.cos(0.4 * row) - 1.0
            lines.append(f"X{x:.3f} Z{z:.3f}")
    return "\n".join([*lines, "G0 Z10.", "M5", "G91 G28 Z0. M9", "G90", "M30", "%"]) + "\n"
