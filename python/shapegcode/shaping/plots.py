"""The pictures of ``shapegcode shaper``: duration, residual, impulses and step response of the designs."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from functools import partial
from itertools import cycle

import numpy as np
from matplotlib.axes import Axes

from shapegcode import _core
from shapegcode._core import ArgumentError, MinimalBranches, Mode, Shaper, minimal_branches
from shapegcode.io.units import FloatArray
from shapegcode.results import plot
from shapegcode.results.outcome import Plot
from shapegcode.shaping.bands import Design, ModeBand, mode_band
from shapegcode.shaping.result import Recommendation, times_name

_CURVES = 6
_MIN_RATIO = 1.02
_RATIO_STEP = 0.02
_BRANCH_CYCLES = 1.0  # cycles of the slower mode: longer minimal shapers are of no interest
_FREQUENCIES = 601
_PERIODS_IN_DURATION = 2.0
_SAMPLES_OF_A_STEP = 3000
_CYCLES_SHOWN = 3.0  # cycles of the slowest mode after the longest shaper
Shapers = Recommendation | Shaper | Sequence[Shaper] | Mapping[str, Shaper]


def plots_of(result: Recommendation) -> dict[str, Plot]:
    """Pictures by name; branches only for two modes with minimal shapers."""
    found: dict[str, Plot] = {
        "shaper-pareto": partial(plot_pareto, result),
        "shaper-sensitivity": partial(plot_sensitivity, result),
        "shaper-impulses": partial(plot_impulses, result),
        "shaper-steps": partial(plot_steps, result),
    }
    branches = _branches(result)
    if branches is not None:
        found["shaper-branches"] = partial(_draw_branches, branches, result)
    return found


def selected(result: Recommendation) -> list[Design]:
    """Designs to draw, at most six: those recommended, then one per other family; those of the Pareto front first."""
    indices = list(dict.fromkeys(each for each in (result.recommended, result.recommended_on_grid) if each is not None))
    negative = result.allow_negative or result.design.negative
    shown = [index for index in result.shown() if negative or not result.designs[index].negative]
    families = {result.designs[index].family for index in indices}
    seen = {_taps(result.designs[index]) for index in indices}
    for pareto in (True, False):
        others = []
        for index in shown:
            each = result.designs[index]
            if each.pareto == pareto and each.family not in families and _taps(each) not in seen:
                families.add(each.family)
                seen.add(_taps(each))
                others.append(index)
        room = min(_CURVES - len(indices), len(others))
        indices += [others[round(step)] for step in np.linspace(0, len(others) - 1, room)] if room > 0 else []
    return [result.designs[index] for index in indices]


def _taps(each: Design) -> tuple[float, ...]:
    return tuple(float(f"{value:.9g}") for value in (*each.shaper.times_s, *each.shaper.amplitudes))


def _curves_and_bands(
    result: Shapers, modes: Sequence[float | str | Mode | ModeBand]
) -> tuple[list[tuple[str, Shaper, str]], Sequence[ModeBand]]:
    """Name in the legend, shaper and colour of each curve; and the modes."""
    bands = result.modes if isinstance(result, Recommendation) else [mode_band(each) for each in modes]
    if isinstance(result, Recommendation):
        shapers: Mapping[str, Shaper] = {
            f"{each.family}, {each.duration_s * 1e3:.4g} ms"
            + (f" ({times_name(each.period_s)})" if each.period_s is not None else ""): each.shaper
            for each in selected(result)
        }
    elif isinstance(result, Shaper):
        shapers = {"shaper": result}
    elif isinstance(result, Mapping):
        shapers = result
    else:
        shapers = {f"shaper {number}": each for number, each in enumerate(result, 1)}
    return [(*each, colour) for each, colour in zip(shapers.items(), cycle(plot.COLOURS), strict=False)], bands


def plot_pareto(result: Recommendation, ax: Axes | None = None) -> Axes:
    """Plot worst residual and contour cost (variance of impulses) over duration.

    Designs on the Pareto front are filled, the recommended one is ringed.

    Args:
        result: the comparison.
        ax: axes to divide; None: a new figure.

    Returns:
        The upper panel.
    """
    upper, lower = plot.column(
        ax, 2, size_inch=(9.0, 7.0), part=", ".join(map(str, result.modes)),
        title="Duration against residual vibration: filled = Pareto front, ringed = recommended",
    )  # fmt: skip
    families = list(dict.fromkeys(each.family for each in result.designs))
    colours = {family: plot.COLOURS[number % len(plot.COLOURS)] for number, family in enumerate(families)}
    markers = {family: "osD^vP*X"[number // len(plot.COLOURS) % 8] for number, family in enumerate(families)}
    values: tuple[tuple[Axes, Callable[[Design], float]], ...] = (
        (upper, lambda each: 100.0 * each.worst_residual),
        (lower, lambda each: abs(each.variance_s2) * 1e6),
    )
    for panel, value in values:
        for each in result.designs:
            colour = colours[each.family]
            panel.plot(
                each.duration_s * 1e3, value(each), marker=markers[each.family], linestyle="none", markersize=7,
                markeredgecolor=colour, markerfacecolor=colour if each.pareto else "none",
                alpha=1.0 if each.pareto else 0.6,
            )  # fmt: skip
        panel.plot(
            result.design.duration_s * 1e3, value(result.design), marker="o", linestyle="none", markersize=16,
            markerfacecolor="none", markeredgecolor="black",
        )  # fmt: skip
        panel.margins(0.05)
    for family in families:
        upper.plot([], [], marker=markers[family], linestyle="none", color=colours[family], label=family)
    upper.axhline(
        100.0 * result.vibration_limit, color=plot.GREY, linewidth=1.0, linestyle="--",
        label=f"limit {100.0 * result.vibration_limit:g} %",
    )  # fmt: skip
    upper.set_ylabel("worst residual in %")
    lower.set(xlabel="duration in ms", ylabel="|σ²| in ms²: µm on R20 at 200 mm/s")
    plot.legend_below(lower, of=upper, columns=5)
    return upper


def plot_sensitivity(
    result: Shapers, ax: Axes | None = None, *, modes: Sequence[float | str | Mode | ModeBand] = ()
) -> Axes:
    """Plot the residual vibration over the frequency of a mode, bands shaded.

    Args:
        result: a comparison (one curve for each of `selected`, the limit dashed), a shaper, several, or by name.
        modes: modes to mark if shapers are given, as for `choose_shaper`; empty: curves without damping, up to the
            frequency with 2.5 cycles in the duration of the longest shaper.
        ax: where to draw; None: a new figure.

    Returns:
        The axes of the plot.
    """
    curves, bands = _curves_and_bands(result, modes)
    vibration_limit = result.vibration_limit if isinstance(result, Recommendation) else None
    panel = plot.axes(ax, size_inch=(9.0, 5.4), title="Residual vibration at other frequencies")
    panel.text(
        1.0, 1.01, "curves turn at 0, as an amplitude has no sign", ha="right", fontsize=8,
        color="#555555", transform=panel.transAxes,
    )  # fmt: skip
    longest_s = max(shaper.duration_s for _, shaper, _ in curves)
    highest = max(
        (band.mode.frequency_hz * (1.0 + band.uncertainty) for band in bands),
        default=_PERIODS_IN_DURATION / longest_s if longest_s > 0.0 else 1.0,
    )
    frequencies_hz = np.linspace(0.0, 1.25 * highest, _FREQUENCIES)[1:]
    nominal = [band.mode for band in bands]
    for label, shaper, colour in curves:
        percent = 100.0 * residual_curve(shaper, frequencies_hz, nominal)
        panel.plot(frequencies_hz, percent, label=label, color=colour, linewidth=1.6)
    for band in bands:
        frequency, width = band.mode.frequency_hz, band.mode.frequency_hz * band.uncertainty
        panel.axvspan(frequency - width, frequency + width, color="#e4e4e4", zorder=0)
        panel.axvline(frequency, color=plot.GREY, linewidth=0.8, zorder=0)
        panel.annotate(
            f" mode {frequency:g} Hz" + (f" ±{100.0 * band.uncertainty:g} %" if width else ""), (frequency, 0.97),
            xycoords=panel.get_xaxis_transform(), fontsize=8, color="#555555", va="top",
        )  # fmt: skip
    if vibration_limit is not None:
        panel.axhline(
            100.0 * vibration_limit, color="black", linewidth=1.0, linestyle="--", zorder=1,
            label=f"limit {100.0 * vibration_limit:g} %",
        )  # fmt: skip
    panel.set_ylim(bottom=0.0)
    panel.margins(x=0.01)
    panel.set(xlabel="natural frequency in Hz", ylabel="residual vibration in %")
    plot.legend_below(panel, columns=3)
    return panel


def plot_impulses(result: Shapers, ax: Axes | None = None) -> Axes:
    """Plot the impulses, one panel for each shaper.

    Args:
        result: a comparison (one panel for each of `selected`), a shaper, or shapers by name.
        ax: axes to divide; None: a new figure.

    Returns:
        The upper panel.
    """
    curves, _ = _curves_and_bands(result, ())
    panels = plot.column(ax, len(curves), size_inch=(9.0, 1.2 + 1.35 * len(curves)), title="Impulses")
    unit, scale = _time_unit(max(shaper.duration_s for _, shaper, _ in curves))
    for panel, (label, shaper, colour) in zip(panels, curves, strict=True):
        panel.vlines(shaper.times_s * scale, 0.0, shaper.amplitudes, color=colour, linewidth=2.5)
        panel.plot(shaper.times_s * scale, shaper.amplitudes, "o", color=colour, markersize=4)
        panel.axhline(0.0, color="black", linewidth=0.8)
        panel.set_title(label, loc="left", fontsize=9)
        panel.margins(x=0.03, y=0.15)
    panels[-1].set_xlabel(f"time in {unit}")
    return panels[0]


def plot_steps(result: Shapers, ax: Axes | None = None, *, modes: Sequence[float | str | Mode | ModeBand] = ()) -> Axes:
    """Plot a shaped unit step (staircase) and the response of the modes. Grey: unshaped.

    Args:
        result: a comparison (one curve for each of `selected`), a shaper, or shapers by name.
        modes: modes that respond if shapers are given, at least one, as for `choose_shaper`.
        ax: axes to divide; None: a new figure.

    Returns:
        The upper panel.

    Raises:
        ArgumentError: a shaper without modes.
    """
    curves, bands = _curves_and_bands(result, modes)
    if not bands:
        raise ArgumentError("modes: 0 given: a step is drawn with the modes that follow it, at least one")
    nominal = [band.mode for band in bands]
    slowest_s = 1.0 / min(band.mode.frequency_hz for band in bands)
    until_s = max(shaper.duration_s for _, shaper, _ in curves) + _CYCLES_SHOWN * slowest_s
    period_s = until_s / _SAMPLES_OF_A_STEP
    unit, scale = _time_unit(until_s)
    panels = plot.column(
        ax, 1 + len(nominal), size_inch=(9.0, 2.2 + 1.9 * (1 + len(nominal))),
        title="Step after each shaper, and response of the modes (grey: unshaped)",
    )  # fmt: skip
    for label, shaper, colour in [("", Shaper([0.0], [1.0]), plot.GREY), *curves]:
        command = shaped_step(shaper, period_s, until_s)
        times = np.arange(len(command)) * (period_s * scale)
        commands = np.tile(command[:, None], (1, len(nominal)))
        responses = _core.plant_response(commands, [[mode] for mode in nominal], period_s)
        if label:
            panels[0].plot(times, command, color=colour, linewidth=1.6, label=label)
        for panel, response in zip(panels[1:], responses.T, strict=True):
            panel.plot(times, response, color=colour, linewidth=1.4 if label else 0.8)
    panels[0].set_ylabel("command")
    for panel, mode in zip(panels[1:], nominal, strict=True):
        panel.set_ylabel(f"{mode.frequency_hz:g} Hz")
    panels[-1].set_xlabel(f"time in {unit}")
    panels[-1].margins(x=0.01)
    plot.legend_below(panels[-1], of=panels[0], columns=3)
    return panels[0]


def plot_branches(result: Recommendation, ax: Axes | None = None) -> Axes:
    """Plot the duration of minimal shapers over the frequency of the faster of two modes.

    Args:
        result: a comparison for two modes.
        ax: where to draw; None: a new figure.

    Returns:
        The axes of the plot.

    Raises:
        ValueError: not two modes, or no minimal shaper that is at most as long as a cycle of the slower mode and the
            longest permitted duration.
    """
    branches = _branches(result)
    if branches is None:
        raise ValueError(f"{len(result.modes)} modes: no branches to draw; they need two modes with a minimal shaper")
    return _draw_branches(branches, result, ax)


def _draw_branches(branches: MinimalBranches, result: Recommendation, ax: Axes | None = None) -> Axes:
    slow, fast = sorted(band.mode.frequency_hz for band in result.modes)
    panel = plot.axes(ax, size_inch=(9.0, 5.0), title=f"Minimal shapers of two modes, the slower one at {slow:g} Hz")
    negative = (branches.amplitudes < 0.0).any(axis=2)
    durations_s = branches.times_s[..., 2]
    unit, scale = _time_unit(float(np.nanmax(durations_s)))
    for has, colour, label in ((True, plot.COLOURS[0], "a negative impulse"), (False, plot.COLOURS[1], "none")):
        curves = np.where(negative == has, durations_s, np.nan)
        panel.plot(branches.ratios * slow, curves.T * scale, color=colour, linewidth=1.4)
        panel.plot([], [], color=colour, label=label)
    panel.axvline(fast, color=plot.GREY, linewidth=0.8, linestyle="--", label=f"the faster mode, {fast:g} Hz")
    panel.set_ylim(bottom=0.0)
    panel.margins(x=0.01)
    panel.set(xlabel="frequency of the faster mode in Hz", ylabel=f"duration in {unit}")
    plot.legend_below(panel, columns=3)
    return panel


def _branches(result: Recommendation) -> MinimalBranches | None:
    """All minimal shapers of two modes for frequency ratios near theirs; None if there are none, or not two modes."""
    if len(result.modes) != 2:
        return None
    slow, fast = sorted((band.mode for band in result.modes), key=lambda mode: mode.frequency_hz)
    ratio = fast.frequency_hz / slow.frequency_hz
    lowest = max(_MIN_RATIO, 0.6 * ratio)
    ratios = np.arange(lowest, max(1.4 * ratio, lowest + 0.2), _RATIO_STEP)
    # Two limits besides the option: curves that can be distinguished, and the search (100 periods of the faster mode).
    longest_s = min(result.max_duration_s, _BRANCH_CYCLES / slow.frequency_hz, 99.0 / (ratios[-1] * slow.frequency_hz))
    branches = minimal_branches(slow, fast.damping_ratio, ratios.tolist(), longest_s)
    return branches if np.isfinite(branches.times_s).any() else None


def residual_curve(shaper: Shaper, frequencies_hz: FloatArray, modes: Sequence[Mode]) -> FloatArray:
    """Residual ratio over frequency, with the damping ratio interpolated between the modes."""
    known = sorted((mode.frequency_hz, mode.damping_ratio) for mode in modes) or [(0.0, 0.0)]
    damping = np.interp(frequencies_hz, [frequency for frequency, _ in known], [ratio for _, ratio in known])
    return np.asarray(shaper.residual(frequencies_hz, damping))


def _time_unit(longest_s: float) -> tuple[str, float]:
    return ("s", 1.0) if longest_s >= 1.0 else ("ms", 1e3)


def shaped_step(shaper: _core.Shaper, period_s: float, until_s: float) -> FloatArray:
    """Shaped unit step (staircase of the impulses), sampled at 0, one period, ... up to at least `until_s`.

    Each impulse becomes a ramp of two periods, whose middle is one period after the impulse: so the first sample is at
    rest, and the times of impulses between samples are preserved.
    """
    times_s = np.arange(round(until_s / period_s) + 2) * period_s
    after = (times_s[:, None] - shaper.times_s[None, :]) / period_s
    return np.asarray(np.clip(0.5 * after, 0.0, 1.0) @ shaper.amplitudes, dtype=np.float64)
