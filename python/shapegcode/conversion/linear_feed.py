"""Shaped blocks of constant feed as fewer blocks whose feed is linear along their path (FLIN of a SINUMERIK).

The control approaches F linearly over the path of a block, from the F before it to its own (easymanua.ls 662833 p. 458,
32519 p. 1606), so a block of length L from v0 to v1 lasts L ln(v1 / v0) / (v1 - v0). Here blocks are joined where the
motion stays within a tolerance of the ends of their periods; ends of blocks come where they came before.
"""

from __future__ import annotations

import math
import re
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import lru_cache
from itertools import pairwise

import numpy as np
import numpy.typing as npt

from shapegcode import _core
from shapegcode.conversion.restart import decimal

Vector = npt.NDArray[np.float64]

_LONGEST = 64  # blocks that one may take the place of
_MISSES = 4  # ends in a row that do not fit, before a longer block is not looked for
_MAX_RATIO = 6.0  # logarithm of the speeds at both ends
_MAX_SWEEP = math.radians(80.0)
_TIME_SHARE = 0.25  # of the tolerance: by how much a block may end too early or late
_SPEED_SHARE = 4.0  # of it: what the difference to the speed of the command may come to in a period
_LINE_SHARE = 0.5  # of it: what bends more is an arc
_POLISHED = 40  # blocks before the end whose speeds are chosen once more
_POLISHED_PERIODS = 2000  # no more than these
_FINE = 10  # steps of a period
_REST_WEIGHT = 30.0  # of vibration at the end against errors of the command
_RIDGE = 0.05
_AT_REST_MM = 2e-5  # of a mode: at rest
_HEAD = 200  # blocks before these, whose vibration counts
_REST_SHARE = 1.5  # of the tolerance: how far that may lead off the command


@dataclass(frozen=True)
class LinearBlock:
    """A block that takes the place of some blocks of constant feed."""

    first: int  # index of the first of them
    last: int  # of the last one
    end_mm: Vector  # where it ends
    radius_mm: float  # of an arc; 0: a line
    sweep_rad: float  # of an arc
    length_mm: float  # of its path
    normal: int  # axis across the plane of an arc
    start_feed: float  # at its start, mm/min
    feed: float  # at its end, mm/min
    sets_feed: bool = False  # the feed at its start is not that of the block before: a line before it says it
    is_linear: bool = True  # False: its feed is constant

    @property
    def time_s(self) -> float:
        """How long it lasts."""
        return duration_s(self.length_mm, self.start_feed / 60.0, self.feed / 60.0)


def duration_s(length_mm: float, start_mm_per_s: float, end_mm_per_s: float) -> float:
    """Time of a block whose speed is linear along its path."""
    ratio = end_mm_per_s / start_mm_per_s - 1.0
    return length_mm / start_mm_per_s * (math.log1p(ratio) / ratio if abs(ratio) > 1e-9 else 1.0)


def end_speed(length_mm: float, start_mm_per_s: float, time_s: float) -> float | None:
    """Speed at the end of a block that lasts a given time, or at its start where these are swapped; None: none."""
    if length_mm <= 0.0 or time_s <= 0.0 or start_mm_per_s <= 0.0:
        return None
    wanted = math.log(time_s * start_mm_per_s / length_mm)  # of log1p(x) / x, which is e**(-y / 2) and little else
    y = -2.0 * wanted
    for _ in range(50):
        y = min(max(y, -_MAX_RATIO - 1.0), _MAX_RATIO + 1.0)
        if abs(y) < 1e-6:
            value, slope = -0.5 * y, -0.5
        else:
            value, slope = math.log(y / math.expm1(y)), 1.0 / y - 1.0 / -math.expm1(-y)
        step = (value - wanted) / slope
        y -= step
        if abs(step) < 1e-13:
            break
    if abs(y) > _MAX_RATIO:
        return None
    return start_mm_per_s * math.exp(y)


def distance_mm(length_mm: float, start_mm_per_s: float, end_mm_per_s: float, times_s: Vector) -> Vector:
    """Distances along such a block at times since its start, (n,)."""
    slope = (end_mm_per_s - start_mm_per_s) / length_mm
    if abs(slope * length_mm) < 1e-9 * start_mm_per_s:
        return start_mm_per_s * times_s
    return np.asarray(start_mm_per_s * np.expm1(slope * times_s) / slope)


def linear_blocks(
    path: _core.Path,
    period_s: float,
    tolerance_mm: float,
    joints: Sequence[int] = (),
    modes: Sequence[tuple[int, float, float]] = (),
) -> list[LinearBlock]:
    """Join blocks of constant feed, each of whole periods, into blocks of linear feed.

    A block begins at each joint; of `modes` (axis, Hz, damping ratio) no vibration is left at the end.
    """
    fit = _JoinedBlocks(path, period_s, tolerance_mm, frozenset(joints))
    blocks = list(fit.blocks())
    return _at_rest(blocks, fit, modes) if modes else blocks


def positions_mm(start_mm: Vector, blocks: Sequence[LinearBlock], times_s: Vector) -> Vector:
    """Where the motion of blocks is at ascending times, (n, 3); behind the last block its end."""
    ends = np.cumsum([block.time_s for block in blocks])
    found = np.tile(blocks[-1].end_mm, (len(times_s), 1))
    begin_s, start = 0.0, start_mm
    for block, end_s in zip(blocks, ends, strict=True):
        inside = (times_s >= begin_s) & (times_s < end_s)
        if inside.any():
            own_s = times_s[inside] - begin_s
            along = distance_mm(block.length_mm, block.start_feed / 60.0, block.feed / 60.0, own_s) / block.length_mm
            found[inside] = _on(start, block, along)
        begin_s, start = end_s, block.end_mm
    return found


def _on(start: Vector, block: LinearBlock, shares: Vector) -> Vector:
    points = start + np.outer(shares, block.end_mm - start)
    if block.sweep_rad == 0.0:
        return points
    first, second = (block.normal + 1) % 3, (block.normal + 2) % 3
    a, b = (complex(each[first], each[second]) for each in (start, block.end_mm))
    # The chord is the spoke at its start, turned by the sweep, less that spoke.
    turn = np.exp(1j * block.sweep_rad)
    spoke = (b - a) / (turn - 1.0)
    flat = a - spoke + spoke * np.exp(1j * block.sweep_rad * shares)
    points[:, first], points[:, second] = flat.real, flat.imag
    return points


def largest_difference_mm(path: _core.Path, blocks: Sequence[LinearBlock], period_s: float) -> float:
    """By how much the motion differs from blocks of constant feed at the ends of their periods."""
    points = _JoinedBlocks(path, period_s, 0.0, frozenset()).points
    times = np.arange(1.0, len(points)) * period_s
    moved = positions_mm(points[0], blocks, times)
    return float(np.linalg.norm(moved - points[1:], axis=1).max())


def linear_lines(
    lines: Mapping[int, str], path: _core.Path, blocks: Sequence[LinearBlock], decimals: int
) -> dict[int, list[str]]:
    """What takes the place of lines of shaped blocks, by their numbers; none where one is joined with another."""
    numbers = [int(number) for number in path.segment_lines]
    written: dict[int, list[str]] = {number: [] for number in numbers}
    is_linear, code, start = False, "", np.asarray(path.start_mm, dtype=float)
    for block in blocks:
        label = _LABEL.match(lines[numbers[block.first]])
        out = written[numbers[block.first]]
        if block.sets_feed:
            out.append(f"{'FNORM ' if is_linear else ''}F{decimal(block.start_feed, 2)}")
            is_linear = False
        change = "" if block.is_linear == is_linear else "FLIN " if block.is_linear else "FNORM "
        is_linear = block.is_linear
        motion = "G1" if not block.sweep_rad else "G3" if block.sweep_rad > 0.0 else "G2"
        words = "" if motion == code else f"{motion} "
        code = motion
        moved = np.abs(np.round(block.end_mm, decimals) - np.round(start, decimals)) > 0.5 * 10.0**-decimals
        words += "".join(f"{'XYZ'[k]}{decimal(float(block.end_mm[k]), decimals)}" for k in range(3) if moved[k])
        words += f"CR={decimal(block.radius_mm, 3)}" if block.sweep_rad else ""
        out.append(f"{change}{words}F{decimal(block.feed, 2 if block.is_linear else 4)}")
        if label is not None:
            out[0] = f"{label[0]} {out[0]}"
        start = block.end_mm
    if is_linear:
        written[numbers[-1]].append("FNORM")
    return written


def joints_of(lines: Mapping[int, str], numbers: Sequence[int]) -> list[int] | None:
    """Blocks that must begin one: behind other lines, and those with N words; None: a line is no mere move."""
    if not all(_MERE_MOVE.fullmatch(lines[number]) for number in numbers):
        return None
    pairs = enumerate(pairwise(numbers), start=1)
    return [k for k, (before, number) in pairs if number != before + 1 or lines[number].startswith("N")]


_LABEL = re.compile(r"N\d+")
_MERE_MOVE = re.compile(r"(?:N\d+)?(?:G0?[123])?(?:[XYZIJKRF]-?(?:\d+\.\d*|\.\d+))+")


@dataclass(frozen=True)
class _Shape:
    """A line or an arc between two ends of blocks, and the command beside it."""

    length_mm: float
    radius_mm: float
    sweep_rad: float
    along_mm: Vector  # of the periods between its ends
    aside_mm: Vector


class _JoinedBlocks:
    """Chooses the blocks one after another, each as long as it may be."""

    def __init__(self, path: _core.Path, period_s: float, tolerance_mm: float, joints: frozenset[int]) -> None:
        self.period_s, self.tolerance_mm, self._joints = period_s, tolerance_mm, joints
        self._segments = [path[k] for k in range(len(path))]
        points, self._knots = [np.asarray(path.start_mm, dtype=float)], [0]
        for segment in self._segments:
            count = max(1, round(segment.length_mm / segment.feed_mm_per_s / period_s))
            points += [np.asarray(segment.point_at(segment.length_mm * k / count)) for k in range(1, count)]
            points.append(np.asarray(segment.end_mm))
            self._knots.append(len(points) - 1)
        self.points = np.array(points)
        self._shape = lru_cache(maxsize=512)(self._shape_between)

    def blocks(self) -> Iterator[LinearBlock]:
        at, speed, late_s, count = 0, 0.0, 0.0, len(self._segments)
        while at < count:
            block, late = self._longest(at, speed, late_s) if speed > 0.0 else (None, 0.0)
            taken = 0 if block is None else block.last - at + 1
            fresh, fresh_late = self._begun(at, late_s)
            if fresh is not None and fresh.last - at + 1 > taken + 1:  # it costs a line of its own
                block, late = fresh, fresh_late
            if block is None:
                block, late = self._single(at, late_s)
            yield block
            at, speed, late_s = block.last + 1, block.feed / 60.0, late
            if at in self._joints:
                speed, late_s = 0.0, 0.0  # other lines stand here, or somebody may begin here

    def ends(self, blocks: Sequence[LinearBlock]) -> list[int]:
        return [self._knots[block.last + 1] for block in blocks]

    def _time_s(self, at: int, end: int) -> float:
        return (self._knots[end] - self._knots[at]) * self.period_s

    def _speed_at(self, knot: int) -> float:
        m = self._knots[knot]
        before, behind = max(m - 1, 0), min(m + 1, len(self.points) - 1)
        step = self.points[behind] - self.points[before]
        return float(np.linalg.norm(step)) / ((behind - before) * self.period_s)

    def _bias(self, at: int, end: int) -> float:
        """Excess of the speeds at the ends over those of the command, so that the block keeps its mean speed.

        The mean over time of a speed that is linear over the path is the logarithmic mean of those at its ends.
        """
        before, behind = self._speed_at(at), self._speed_at(end)
        return (behind - before) ** 2 / (6.0 * max(before + behind, 1e-9))

    def _single(self, at: int, late_s: float) -> tuple[LinearBlock, float]:
        """The block alone. Where the command accelerates its feed is linear too: one kind of interpolation throughout.

        A shaper leaves no vibration behind a command that is interpolated in one way between the ends of its periods; a
        constant feed here and there is a bow of a T² / 8 against the others, and excites the modes.
        """
        before, behind = self._speed_at(at), self._speed_at(at + 1)
        is_short = self._knots[at + 1] - self._knots[at] == 1
        if is_short and abs(behind - before) * self.period_s > 2.0 * self.tolerance_mm:
            shape, whole_s = self._shape(at, at + 1), self._time_s(at, at + 1)
            start = _written(before + self._bias(at, at + 1)) if at else 0.0
            end = None if shape is None else end_speed(shape.length_mm, start, whole_s - late_s)
            if shape is not None and end is not None and (last := _written(end)) > 0.0:
                late = late_s + duration_s(shape.length_mm, start, last) - whole_s
                return self._made(at, at + 1, shape, start, last, sets_feed=True), late
        return self._constant(at, late_s)

    def _made(self, at: int, end: int, shape: _Shape, speed: float, last: float, *, sets_feed: bool) -> LinearBlock:
        return LinearBlock(
            at, end - 1, self.points[self._knots[end]], shape.radius_mm, shape.sweep_rad, shape.length_mm,
            self._segments[at].normal, speed * 60.0, last * 60.0, sets_feed,
        )  # fmt: skip

    def _constant(self, at: int, late_s: float) -> tuple[LinearBlock, float]:
        """The block as it was; it makes up for what the one before was late."""
        segment, whole_s = self._segments[at], self._time_s(at, at + 1)
        feed = round(segment.length_mm / (whole_s - late_s) * 60.0, 4)
        radius = segment.radius_mm if segment.sweep_rad else 0.0
        block = LinearBlock(
            at, at, np.asarray(segment.end_mm), radius, segment.sweep_rad, segment.length_mm, segment.normal, feed,
            feed, is_linear=False,
        )  # fmt: skip
        return block, late_s + block.time_s - whole_s

    def _begun(self, at: int, late_s: float) -> tuple[LinearBlock | None, float]:
        """The longest block whose feed at its start is free."""
        speed = self._speed_at(at) if at else 0.0
        if speed * self.period_s > self.tolerance_mm:
            return self._longest(at, None, late_s)
        found: tuple[LinearBlock | None, float] = (None, 0.0)
        for end in range(at + 1, min(at + 4, len(self._segments))):
            # From rest: the speed that leads to that of the command.
            shape = self._shape(at, end)
            time_s = self._time_s(at, end) - late_s
            start = None if shape is None else end_speed(shape.length_mm, self._speed_at(end), time_s)
            if start is not None and start > 0.0 and _written(start) > 0.0:
                block, late = self._block(at, end, _written(start), late_s, sets_feed=True)
                found = (block, late) if block is not None else found
        return found

    def _longest(self, at: int, speed: float | None, late_s: float) -> tuple[LinearBlock | None, float]:
        found: tuple[LinearBlock | None, float] = (None, 0.0)
        misses = 0
        for end in range(at + 1, min(at + _LONGEST, len(self._segments)) + 1):
            start = _written(self._speed_at(at) + self._bias(at, end)) if speed is None else speed
            block, late = self._block(at, end, start, late_s, sets_feed=speed is None)
            misses = misses + 1 if block is None else 0
            found = found if block is None else (block, late)
            if misses > _MISSES or end in self._joints:
                break
        return found

    def _block(
        self, at: int, end: int, speed: float, late_s: float, *, sets_feed: bool
    ) -> tuple[LinearBlock | None, float]:
        """A block between two ends, if its motion stays within the tolerance, and how late it ends."""
        shape = self._shape(at, end)
        whole_s = self._time_s(at, end)
        time_s = whole_s - late_s
        if shape is None or (exact := end_speed(shape.length_mm, speed, time_s)) is None:
            return None, 0.0
        wanted = self._speed_at(end) + self._bias(at, end) if end < len(self._segments) else exact
        slack_s = _TIME_SHARE * self.tolerance_mm / max(speed, wanted, exact)
        slowest, fastest = (end_speed(shape.length_mm, speed, time_s + sign * slack_s) or exact for sign in (1.0, -1.0))
        last = _written(min(max(wanted, slowest), fastest))
        if last <= 0.0 or abs(last - wanted) * self.period_s > _SPEED_SHARE * self.tolerance_mm:
            return None, 0.0
        late = late_s + duration_s(shape.length_mm, speed, last) - whole_s
        times = np.arange(1.0, len(shape.along_mm) + 1.0) * self.period_s - late_s
        along = distance_mm(shape.length_mm, speed, last, np.asarray(times)) - shape.along_mm
        off = float(np.hypot(along, shape.aside_mm).max(initial=0.0))
        if off > self.tolerance_mm or abs(late) * max(last, wanted) > 2.0 * _TIME_SHARE * self.tolerance_mm:
            return None, 0.0
        block = self._made(at, end, shape, speed, last, sets_feed=sets_feed)
        return block, late

    def _shape_between(self, at: int, end: int) -> _Shape | None:
        points = self.points[self._knots[at] : self._knots[end] + 1]
        if end == at + 1 and self._segments[at].sweep_rad:
            segment = self._segments[at]
            along = segment.length_mm * np.arange(1, len(points) - 1) / (len(points) - 1)
            return _Shape(segment.length_mm, segment.radius_mm, segment.sweep_rad, along, np.zeros(len(along)))
        chord = points[-1] - points[0]
        length = float(np.linalg.norm(chord))
        if length == 0.0:
            return None
        along = (points[1:-1] - points[0]) @ chord / length
        aside = np.linalg.norm(points[1:-1] - points[0] - np.outer(along, chord / length), axis=1)
        if aside.max(initial=0.0) <= _LINE_SHARE * self.tolerance_mm:
            return _Shape(length, 0.0, 0.0, along, aside)
        return self._arc(points, length, self._segments[at].normal)

    def _arc(self, points: Vector, chord_mm: float, normal: int) -> _Shape | None:
        first, second = (normal + 1) % 3, (normal + 2) % 3
        if np.ptp(points[:, normal]) > 0.0 or chord_mm < 0.02:
            return None
        flat = points[:, first] + 1j * points[:, second]
        turned = (flat - flat[0]) / (flat[-1] - flat[0]) * chord_mm  # the chord along the first axis
        height = float(turned[len(turned) // 2].imag)
        half, x = 0.5 * chord_mm, float(turned[len(turned) // 2].real) - 0.5 * chord_mm
        if height == 0.0:
            return None
        # x² + (height - y)² = half² + y²: the centre lies at y on the middle of the chord
        y = (x * x + height * height - half * half) / (2.0 * height)
        radius = round(math.hypot(half, y), 3)
        if radius <= half or radius > 9999.0:
            return None
        y = -math.copysign(math.sqrt(radius * radius - half * half), height)
        spokes = turned - (half + 1j * y)
        sweep = -math.copysign(2.0 * math.asin(half / radius), height)
        angles = np.abs(np.angle(spokes[1:-1] / spokes[0]))
        if abs(sweep) > _MAX_SWEEP:
            return None
        return _Shape(radius * abs(sweep), radius, sweep, radius * angles, np.abs(np.abs(spokes[1:-1]) - radius))


def _at_rest(
    blocks: list[LinearBlock], fit: _JoinedBlocks, modes: Sequence[tuple[int, float, float]]
) -> list[LinearBlock]:
    """The last blocks with speeds that leave the modes at rest and stay near the command: least squares.

    A micrometre of error at a mode's frequency, in some blocks before the end, is several of vibration behind it.
    """
    points, ends, period_s = fit.points, fit.ends(blocks), fit.period_s
    first = max(0, len(blocks) - _POLISHED)
    while first < len(blocks) - 1 and ends[-1] - (ends[first - 1] if first else 0) > _POLISHED_PERIODS:
        first += 1
    tail, begin = blocks[first:], ends[first - 1] if first else 0
    start, window = points[begin], points[begin + 1 :]
    times = np.arange(1.0, len(window) + 1.0) * period_s
    late_s = sum(block.time_s for block in blocks[:first]) - begin * period_s
    step_s = period_s / _FINE
    fine: Vector = np.arange(1.0, _FINE * len(window) + 2 * _FINE) * step_s
    poles = [(axis, math.tau * frequency * complex(-damping, 1.0)) for axis, frequency, damping in modes]
    # What the blocks before have left of each mode at the end of the last one.
    head = blocks[max(0, first - _HEAD) : first]
    head_start = points[ends[first - 1 - len(head)] if first > len(head) else 0]
    head_s = sum(block.time_s for block in head)
    own: Vector = np.arange(1.0, math.ceil(head_s / step_s) + 1.0) * step_s
    moved = np.diff(positions_mm(head_start, head, own), axis=0, prepend=head_start[None]) if head else np.zeros((0, 3))
    ages = fine[-1] + head_s - own + 0.5 * step_s
    before = np.array([moved[:, axis] @ np.exp(pole * ages) for axis, pole in poles])

    def rows(speeds: Vector) -> Vector:
        made = _with_speeds(tail, speeds)
        errors = (positions_mm(start, made, times - late_s) - window).ravel()
        steps = np.diff(positions_mm(start, made, fine), axis=0, prepend=start[None])
        left = before + [steps[:, axis] @ np.exp(pole * (fine[-1] - fine + 0.5 * step_s)) for axis, pole in poles]
        return np.concatenate([errors, _REST_WEIGHT * np.real(left), _REST_WEIGHT * np.imag(left)])

    speeds = np.array([speed for block in tail for speed in (block.start_feed, block.feed)])
    free = _free_speeds(tail)
    unit = np.repeat([0.01 if block.is_linear else 0.0001 for block in tail], 2)  # as they are written
    best, best_rows = speeds, rows(speeds)
    for _ in range(4):
        if np.abs(best_rows[window.size :]).max() < _REST_WEIGHT * _AT_REST_MM:
            break
        jacobian = np.array([(rows(best + step) - best_rows) for step in free])
        sizes = np.linalg.norm(jacobian, axis=1)
        system = np.vstack([(jacobian / sizes[:, None]).T, _RIDGE * np.eye(len(free))])
        change = np.linalg.lstsq(system, np.concatenate([-best_rows, np.zeros(len(free))]), rcond=None)[0] / sizes
        for share in (1.0, 0.5, 0.25):
            tried = np.round((best + share * (change @ free)) / unit) * unit
            if tried.min() <= 0.0:
                continue
            found = rows(tried)
            off = np.linalg.norm(found[: window.size].reshape(-1, 3), axis=1).max()
            if off <= _REST_SHARE * fit.tolerance_mm and found @ found < best_rows @ best_rows:
                best, best_rows = tried, found
                break
        else:
            break
    return blocks[:first] + _with_speeds(tail, best)


def _free_speeds(blocks: Sequence[LinearBlock]) -> Vector:
    """Changes of the speeds at both ends of blocks, shape (n, 2 blocks): a speed that two blocks share is one."""
    changes = []
    for k, block in enumerate(blocks):
        if block.sets_feed:
            changes.append({2 * k})
        if not block.is_linear:
            changes.append({2 * k, 2 * k + 1})
        else:
            changes.append({2 * k + 1})
        if k + 1 < len(blocks) and not blocks[k + 1].sets_feed and blocks[k + 1].is_linear:
            changes[-1].add(2 * k + 2)
    found = np.zeros((len(changes), 2 * len(blocks)))
    for row, indices in zip(found, changes, strict=True):
        row[list(indices)] = 1.0
    return found


def _with_speeds(blocks: Sequence[LinearBlock], speeds: Vector) -> list[LinearBlock]:
    return [
        replace(block, start_feed=float(speeds[2 * k]), feed=float(speeds[2 * k + 1])) for k, block in enumerate(blocks)
    ]


def _written(speed_mm_per_s: float) -> float:
    """A speed as its F is written: a tenth of mm/min, a hundredth below 100."""
    return round(speed_mm_per_s * 60.0, 1 if speed_mm_per_s > 100.0 / 60.0 else 2) / 60.0
