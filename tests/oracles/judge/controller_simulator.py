"""A controller with hidden facts that plays test programs: servo logs and stopwatch times to hold a fit against.

NumPy and SciPy only; shares no code with the package. It reads the written text, plays it as paper 004 describes
(blocks of whole interpolation periods or with the rest carried on, velocity profiles smoothed after interpolation,
rapids with constant acceleration, in-position waits), samples the command at its interpolation ticks and holds it
between them.
"""

from __future__ import annotations

import math
import re
from dataclasses import dataclass
from typing import Literal

import numpy as np
import numpy.typing as npt
from scipy.interpolate import PPoly

Array = npt.NDArray[np.float64]
_DUST = 1e-6


@dataclass(frozen=True)
class Hidden:
    """What the fit is to find out; s, mm/s, mm."""

    period_s: float = 0.001
    block_end: Literal["ceil", "carry"] = "ceil"
    block_time_s: float = 0.005
    shape: Literal["linear", "bell", "exponential"] = "linear"
    time_constant_s: float = 0.05
    bell_s: float = 0.0
    rapid_mm_s: float = 400.0
    rapid_time_constant_s: float = 0.15
    rapid_bell_s: float = 0.0
    in_position_s: tuple[float, float, float] = (0.025, 0.025, 0.12)
    end_width_mm: float = 0.002  # an exponential deceleration counts as ended within it
    position_gain: float = 30.0
    feed_forward: float = 0.0
    dwell_waits_in_position: bool = False


@dataclass(frozen=True)
class Block:
    kind: Literal["rapid", "cut", "dwell"]
    delta: tuple[float, float, float] = (0.0, 0.0, 0.0)
    feed: float = 0.0  # mm/s
    dwell_s: float = 0.0
    exact: bool = False


def read(text: str) -> list[Block]:
    """Blocks of a test program; anything that a test program must not hold is an error."""
    blocks: list[Block] = []
    motion, exact, feed, ended = "", False, 0.0, False
    for line in text.replace("%", "").splitlines():
        words = re.findall(r"([A-Z])([-+.\d]+)", re.sub(r"\([^()]*\)", "", line))
        if re.sub(r"\([^()]*\)|[A-Z][-+.\d]+|\s", "", line):
            raise ValueError(f"cannot read {line!r}")
        delta, dwell = [0.0, 0.0, 0.0], None
        for address, value in words:
            if address == "G":
                code = int(value)
                if code in (0, 1):
                    motion = "rapid" if code == 0 else "cut"
                elif code in (61, 64):
                    exact = code == 61
                elif code not in (4, 17, 21, 90, 91, 94):
                    raise ValueError(f"G{value} is not expected")
                ended |= code == 90
            elif address in "XYZ":
                if "." not in value or ended:
                    raise ValueError(f"{line!r}: no decimal point, or a move after G90")
                delta["XYZ".index(address)] = float(value)
            elif address == "F":
                feed = float(value) / 60.0
            elif address == "P":
                dwell = int(value) / 1000.0
            elif address not in "OM" or (address == "M" and int(value) != 30):
                raise ValueError(f"{address}{value} is not expected")
        if dwell is not None:
            blocks.append(Block("dwell", dwell_s=dwell))
        elif any(delta):
            blocks.append(Block(motion, (delta[0], delta[1], delta[2]), feed, exact=exact))  # type: ignore[arg-type]
    return blocks


def _ticks(duration: float, period: float) -> int:
    return math.ceil(duration / period - _DUST)


class _Curve:
    """A piecewise linear function with its first two antiderivatives."""

    def __init__(self, times: Array, values: Array) -> None:
        self.t = np.concatenate([[times[0] - 1e3], times, [times[-1] + 1e3]])
        q = np.concatenate([[values[0]], values, [values[-1]]])
        step = np.diff(self.t)
        self.slope = np.diff(q) / np.where(step > 0, step, 1.0)
        self.value = PPoly(np.array([self.slope, q[:-1]]), self.t)
        self.one, self.two = self.value.antiderivative(), self.value.antiderivative(2)

    def averaged(self, times: Array, a: float, b: float) -> Array:
        """Moving averages of length a and b in series."""
        if a == 0.0 and b == 0.0:
            return np.asarray(self.value(times))
        if a == 0.0 or b == 0.0:
            c = a + b
            return np.asarray((self.one(times) - self.one(times - c)) / c)
        second = [self.two(times - lag) for lag in (0.0, a, b, a + b)]
        return np.asarray((second[0] - second[1] - second[2] + second[3]) / (a * b))

    def lagged(self, times: Array, tau: float) -> Array:
        """First-order lag."""
        gap = np.zeros(len(self.t))  # lagged minus function at each knot
        for k, (step, slope) in enumerate(zip(np.diff(self.t), self.slope, strict=True)):
            gap[k + 1] = -slope * tau + (gap[k] + slope * tau) * math.exp(-step / tau)
        i = np.clip(np.searchsorted(self.t, times, side="right") - 1, 0, len(self.slope) - 1)
        s, d = self.slope[i], times - self.t[i]
        return np.asarray(self.value(times) - s * tau + (gap[i] + s * tau) * np.exp(-d / tau))


def _run_knots(run: list[Block], hidden: Hidden, override: float) -> tuple[Array, Array, int]:
    """Knots of the unsmoothed path of a run of cutting blocks, and its length in ticks."""
    period = hidden.period_s
    times, points, now = [0.0], [np.zeros(3)], 0.0
    for block in run:
        length = math.hypot(*block.delta)
        nominal = length / (block.feed * override)
        end = points[-1] + np.array(block.delta)
        lasts = max(nominal, hidden.block_time_s) if len(run) > 1 else nominal
        lasts = _ticks(lasts, period) * period if hidden.block_end == "ceil" else lasts
        times += [now + nominal] + ([now + lasts] if lasts > nominal + 1e-12 else [])
        points += [end] + ([end] if lasts > nominal + 1e-12 else [])
        now += lasts
    return np.array(times), np.array(points), _ticks(now, period)


def play(text: str, hidden: Hidden, override: float = 1.0, *, positions: bool = True) -> tuple[Array, float]:
    """Set-points at the ticks, shape (n, 3), from the origin on, and the duration of the program in s."""
    blocks = read(text)
    period = hidden.period_s
    at = np.zeros(3)
    rows: list[Array] = [at[None, :].copy()]
    total = i = 0

    def stand(ticks: int) -> None:
        nonlocal total
        total += ticks
        if positions and ticks:
            rows.append(np.repeat(at[None, :], ticks, axis=0))

    def wait(delta: Array) -> None:
        moved = [p for p, d in zip(hidden.in_position_s, delta, strict=True) if d != 0.0]
        stand(_ticks(max(moved), period))

    while i < len(blocks):
        block = blocks[i]
        if block.kind == "dwell":
            stand(_ticks(block.dwell_s, period))
            i += 1
            continue
        if block.kind == "rapid":
            delta = np.array(block.delta)
            nominal = float(np.abs(delta).max()) / hidden.rapid_mm_s
            ramp = hidden.rapid_time_constant_s
            if nominal >= ramp:
                rect = _ticks(nominal, period) * period
            else:
                rect = ramp = _ticks(math.sqrt(nominal * ramp), period) * period
            ticks = _ticks(rect + ramp + hidden.rapid_bell_s, period)
            if positions:
                t = np.arange(1, ticks + 1) * period
                share = _RapidShare(rect, ramp, hidden.rapid_bell_s).at(t)
                rows.append(at + share[:, None] * delta)
            total += ticks
            at = at + delta
            wait(delta)
            i += 1
            continue
        j = i + 1
        if not block.exact:
            while j < len(blocks) and blocks[j].kind == "cut" and not blocks[j].exact:
                j += 1
        times, points, rect_ticks = _run_knots(blocks[i:j], hidden, override)
        extra = hidden.time_constant_s + hidden.bell_s
        ticks = rect_ticks + _ticks(extra, period)
        exponential = hidden.shape == "exponential"
        if exponential:
            tau = hidden.time_constant_s
            end = times[-1]
            axis = int(np.abs(points).max(axis=0).argmax())
            left = abs(_Curve(times, points[:, axis]).lagged(np.array([end]), tau)[0] - points[-1, axis])
            ticks = max(rect_ticks, _ticks(end + tau * math.log(max(left / hidden.end_width_mm, 1.0)), period))
        if positions:
            t = np.arange(1, ticks + 1) * period
            out = np.empty((ticks, 3))
            for axis in range(3):
                curve = _Curve(times, points[:, axis])
                if exponential:
                    out[:, axis] = curve.lagged(t, hidden.time_constant_s)
                else:
                    out[:, axis] = curve.averaged(t, hidden.time_constant_s, hidden.bell_s)
            out[-1] = points[-1]
            rows.append(at + out)
        total += ticks
        delta = np.sum([b.delta for b in blocks[i:j]], axis=0)
        moved = np.array(blocks[j - 1].delta)
        at = at + delta
        next_dwell = j < len(blocks) and blocks[j].kind == "dwell"
        if block.exact or (hidden.dwell_waits_in_position and next_dwell):
            wait(moved)
        i = j
    return np.concatenate(rows), total * period


class _RapidShare:
    """Share of a rapid's way that is done at a time: a rectangle of speed, smoothed by two moving averages."""

    def __init__(self, rect: float, ramp: float, bell: float) -> None:
        self._curve = _Curve(np.array([0.0, rect]), np.array([0.0, 1.0]))
        self._ramp, self._bell = ramp, bell

    def at(self, times: Array) -> Array:
        return self._curve.averaged(times, self._ramp, self._bell)


def servo_log(
    text: str,
    hidden: Hidden,
    rng: np.random.Generator,
    *,
    sampling_s: float = 0.001,
    quantum_mm: float = 0.001,
    noise_mm: float = 0.0005,
    hold: bool = True,
    actual: bool = False,
    lead_s: float = 0.35,
) -> Array:
    """Columns time in s, X, Y, Z commanded (and actual), as a control would record them.

    The clock starts at a random time; the record begins before the program and ends after it.
    """
    points, duration = play(text, hidden)
    clock, phase = rng.uniform(0.0, 500.0), rng.uniform(0.0, sampling_s)
    times = np.arange(0.0, duration + 2 * lead_s, sampling_s)
    at = times + phase - lead_s
    ticks = np.arange(len(points)) * hidden.period_s
    if hold:
        index = np.clip(np.floor(at / hidden.period_s + _DUST).astype(int), 0, len(points) - 1)
        command = points[index]
    else:
        command = np.stack([np.interp(at, ticks, points[:, axis]) for axis in range(3)], axis=1)
    columns = [command]
    if actual:
        # The servo sees what the log shows: a held command is on average half a period late.
        late = ticks + (hidden.period_s / 2 if hold else 0.0)
        lag = 1.0 / hidden.position_gain
        lagged = np.stack([_Curve(late, points[:, axis]).lagged(at, lag) for axis in range(3)], axis=1)
        straight = np.stack([np.interp(at, late, points[:, axis]) for axis in range(3)], axis=1)
        columns.append(hidden.feed_forward * straight + (1.0 - hidden.feed_forward) * lagged)
    values = np.concatenate(columns, axis=1)
    values = values + rng.normal(0.0, noise_mm, values.shape)
    values = np.round(values / quantum_mm) * quantum_mm
    return np.concatenate([(times + clock)[:, None], values], axis=1)


def stopwatch_s(
    text: str,
    hidden: Hidden,
    rng: np.random.Generator,
    *,
    override: float = 1.0,
    resolution_s: float = 0.1,
    jitter_s: float = 0.0,
    overhead_s: float = 0.3,
) -> float:
    """What the operator writes down."""
    _, duration = play(text, hidden, override, positions=False)
    value = duration + overhead_s + rng.normal(0.0, jitter_s)
    return round(max(value, resolution_s) / resolution_s) * resolution_s


def draw(rng: np.random.Generator) -> Hidden:
    """A controller at random; times that it can only realise in whole periods are whole periods."""
    period = float(rng.choice([0.001, 0.002, 0.004, 0.008]))

    def whole(low: float, high: float) -> float:
        return max(1, round(rng.uniform(low, high) / period)) * period

    shape = str(rng.choice(["linear", "bell", "exponential"]))
    a = whole(0.020, 0.150)
    ramp = whole(0.060, 0.200)
    end = str(rng.choice(["ceil", "carry"]))
    block_time = float(rng.uniform(0.002, 0.010))
    return Hidden(
        period_s=period,
        block_end=end,  # type: ignore[arg-type]
        block_time_s=math.ceil(block_time / period) * period if end == "ceil" else block_time,
        shape=shape,  # type: ignore[arg-type]
        time_constant_s=a,
        bell_s=min(whole(0.010, 0.050), a) if shape == "bell" else 0.0,
        rapid_mm_s=400.0,
        rapid_time_constant_s=ramp,
        rapid_bell_s=min(whole(0.010, 0.060), ramp) if rng.uniform() < 0.5 else 0.0,
        in_position_s=(whole(0.020, 0.060), whole(0.020, 0.060), whole(0.060, 0.150)),
        end_width_mm=float(rng.uniform(0.001, 0.010)),
        position_gain=float(rng.uniform(20.0, 60.0)),
        feed_forward=float(rng.uniform(0.0, 0.9)) if rng.uniform() < 0.5 else 0.0,
    )
