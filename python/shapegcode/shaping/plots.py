"""The pictures of ``shapegcode shaper``: what the designs cost, what they leave, and what they do to a step."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from shapegcode._core import MinimalBranches, Mode, Shaper, minimal_branches
from shapegcode.results import plot as canvas
from shapegcode.shaping.bands import ModeBand
from shapegcode.shaping.choose import Recommendation
from shapegcode.shaping.design import Design
from shapegcode.shaping.modal_run import respond, shaped_step
from shapegcode.shaping.tables import shown, times_name

if TYPE_CHECKING:
    from matplotlib.axes import Axes

__all__ = [
    "plot_branches", "plot_impulses", "plot_pareto", "plot_sensitivity", "plot_steps", "residual_curve", "selected",
    "write_shaper_pictures",
]  # fmt: skip

_CURVES = 6
_FREQUENCIES = 601
_SAMPLES_OF_A_STEP = 3000
_LEAST_RATIO = 1.02
_RATIO_STEP = 0.02
_BRANCH_SWINGS = 1.0  # of the slower mode: minimal shapers of interest are shorter
_SWINGS_SHOWN = 3.0  # of the slowest mode, behind the longest shaper


def write_shaper_pictures(result: Recommendation, folder: str | Path) -> list[str]:
    """Write ``shaper-pareto``, ``-sensitivity``, ``-impulses``, ``-steps`` and, for two modes, ``-branches``.

    Each as PNG and SVG, into a folder, which is made where it is missing.

    Returns:
        The files written.

    Raises:
        OSError: the folder cannot be made or a file not be written.
    """
    designs = {name(each): each.shaper for each in selected(result)}
    modes = [band.mode for band in result.bands]
    pictures: dict[str, Callable[[Path], None]] = {
        "pareto": lambda file: plot_pareto(file, result),
        "sensitivity": lambda file: plot_sensitivity(file, designs, result.bands, result.options.vibration_limit),
        "impulses": lambda file: plot_impulses(file, designs),
        "steps": lambda file: plot_steps(file, designs, modes),
    }
    branches = _branches(result)
    if branches is not None:
        pictures["branches"] = lambda file: plot_branches(file, branches, modes)
    return canvas.write_pictures(folder, "shaper", pictures)


def name(each: Design) -> str:
    """A design in a legend."""
    return f"{each.family}, {each.duration_s * 1e3:.4g} ms" + (
        f" ({times_name(each.period_s)})" if each.period_s is not None else ""
    )


def selected(result: Recommendation, count: int = _CURVES) -> list[Design]:
    """The designs worth a curve: what is recommended, then one of each family on the Pareto front, from short to long.

    Designs with negative taps are left out where they may not be recommended and there are others.
    """
    places = list(dict.fromkeys([result.index, *([] if result.grid_index is None else [result.grid_index])]))
    negative = result.allow_negative or result.design.negative
    front = [place for place in shown(result) if result.pareto[place]]
    front = [place for place in front if negative or not result.designs[place].negative]
    families = {result.designs[place].family for place in places}
    drawn = {_taps(result.designs[place]) for place in places}
    others = []
    for place in front:
        each = result.designs[place]
        if each.family not in families and _taps(each) not in drawn:
            families.add(each.family)
            drawn.add(_taps(each))
            others.append(place)
    room = min(count - len(places), len(others))
    places += [others[round(step)] for step in np.linspace(0, len(others) - 1, room)] if room > 0 else []
    return [result.designs[place] for place in places]


def _taps(each: Design) -> tuple[float, ...]:
    """Times and amplitudes, to nine digits."""
    return tuple(float(f"{value:.9g}") for value in (*each.shaper.times_s, *each.shaper.amplitudes))


def residual_curve(shaper: Shaper, frequencies_hz: NDArray[np.float64], modes: Sequence[Mode]) -> NDArray[np.float64]:
    """Residual ratio over frequency, each with the damping ratio of the nearest of the modes."""
    damping = [min(modes, key=lambda mode: abs(mode.frequency_hz - f)).damping_ratio for f in frequencies_hz]
    pairs = zip(frequencies_hz, damping, strict=True)
    return np.array([shaper.residual_ratio(Mode(float(f), zeta)) for f, zeta in pairs])


def plot_pareto(file: str | Path, result: Recommendation) -> None:
    """Worst residual and contour cost over duration; the Pareto front filled, what is recommended ringed.

    Raises:
        ValueError: a wrong ending.
        OSError: the file cannot be written.
    """
    figure = canvas.figure(9.0, 7.0)
    upper, lower = canvas.panels(figure, 2, 1)[0]
    families = list(dict.fromkeys(each.family for each in result.designs))
    colours = {family: canvas.COLOURS[number % len(canvas.COLOURS)] for number, family in enumerate(families)}
    markers = {family: "osD^vP*X"[number // len(canvas.COLOURS) % 8] for number, family in enumerate(families)}
    values: tuple[tuple[Axes, Callable[[Design], float]], ...] = (
        (upper, lambda each: 100.0 * each.worst_residual),
        (lower, lambda each: abs(each.variance_s2) * 1e6),
    )
    for panel, value in values:
        for each, pareto in zip(result.designs, result.pareto, strict=True):
            colour = colours[each.family]
            panel.plot(
                each.duration_s * 1e3, value(each), marker=markers[each.family], linestyle="none", markersize=7,
                markeredgecolor=colour, markerfacecolor=colour if pareto else "none", alpha=1.0 if pareto else 0.6,
            )  # fmt: skip
        panel.plot(
            result.design.duration_s * 1e3, value(result.design), marker="o", linestyle="none", markersize=16,
            markerfacecolor="none", markeredgecolor="black",
        )  # fmt: skip
        panel.margins(0.05)
    for family in families:
        upper.plot([], [], marker=markers[family], linestyle="none", color=colours[family], label=family)
    upper.axhline(100.0 * result.options.vibration_limit, color=canvas.GREY, linewidth=1.0, linestyle="--")
    upper.set_ylabel("worst residual in %")
    lower.set_ylabel("|σ²| in ms²: µm on R20 at 200 mm/s")
    lower.set_xlabel("duration in ms")
    canvas.legend_above(upper)
    canvas.heading(figure, "Duration against what is left: filled = Pareto front, ringed = recommended", _modes(result))
    canvas.save(figure, file)


def plot_sensitivity(
    file: str | Path, shapers: dict[str, Shaper], bands: Sequence[ModeBand], vibration_limit: float | None = None
) -> None:
    """Residual ratio over frequency, the bands of the modes shaded.

    Raises:
        ValueError: a wrong ending.
        OSError: the file cannot be written.
    """
    figure = canvas.figure(9.0, 4.8)
    panel = canvas.panels(figure, 1, 1)[0][0]
    highest = max(band.mode.frequency_hz * (1.0 + band.uncertainty) for band in bands)
    frequencies_hz = np.linspace(0.0, 1.25 * highest, _FREQUENCIES)[1:]
    modes = [band.mode for band in bands]
    for number, (label, shaper) in enumerate(shapers.items()):
        panel.plot(
            frequencies_hz, 100.0 * residual_curve(shaper, frequencies_hz, modes), label=label,
            color=canvas.COLOURS[number % len(canvas.COLOURS)], linewidth=1.6,
        )  # fmt: skip
    for band in bands:
        frequency, width = band.mode.frequency_hz, band.mode.frequency_hz * band.uncertainty
        panel.axvspan(frequency - width, frequency + width, color="#e4e4e4", zorder=0)
        panel.axvline(frequency, color=canvas.GREY, linewidth=0.8, zorder=0)
    if vibration_limit is not None:
        panel.axhline(100.0 * vibration_limit, color=canvas.GREY, linewidth=1.0, linestyle="--")
    panel.set_ylim(bottom=0.0)
    panel.set_xlabel("natural frequency in Hz")
    panel.set_ylabel("residual vibration in %")
    _legend(panel)
    canvas.heading(figure, "What is left if the frequency is another one", "")
    canvas.save(figure, file)


def plot_impulses(file: str | Path, shapers: dict[str, Shaper]) -> None:
    """The taps of each shaper.

    Raises:
        ValueError: a wrong ending.
        OSError: the file cannot be written.
    """
    figure = canvas.figure(9.0, 1.2 + 1.35 * len(shapers))
    column = canvas.panels(figure, len(shapers), 1)[0]
    unit, scale = _time_unit(max(shaper.duration_s for shaper in shapers.values()))
    for number, (panel, (label, shaper)) in enumerate(zip(column, shapers.items(), strict=True)):
        colour = canvas.COLOURS[number % len(canvas.COLOURS)]
        panel.vlines(shaper.times_s * scale, 0.0, shaper.amplitudes, color=colour, linewidth=2.5)
        panel.plot(shaper.times_s * scale, shaper.amplitudes, "o", color=colour, markersize=4)
        panel.axhline(0.0, color="black", linewidth=0.8)
        panel.set_title(label, loc="left", fontsize=9)
        panel.margins(x=0.03, y=0.15)
    column[-1].set_xlabel(f"time in {unit}")
    canvas.heading(figure, "Taps", "")
    canvas.save(figure, file)


def plot_steps(file: str | Path, shapers: dict[str, Shaper], modes: Sequence[Mode], *, unshaped: bool = True) -> None:
    """A shaped unit step (the staircase), and how each mode follows it; grey: unshaped.

    Raises:
        ValueError: a wrong ending.
        OSError: the file cannot be written.
    """
    slowest_s = 1.0 / min(mode.frequency_hz for mode in modes)
    until_s = max(shaper.duration_s for shaper in shapers.values()) + _SWINGS_SHOWN * slowest_s
    period_s = until_s / _SAMPLES_OF_A_STEP
    unit, scale = _time_unit(until_s)
    figure = canvas.figure(9.0, 2.2 + 1.9 * (1 + len(modes)))
    column = canvas.panels(figure, 1 + len(modes), 1)[0]
    if unshaped:
        run = respond(modes, shaped_step(Shaper([0.0], [1.0]), period_s, until_s), period_s)
        for place, panel in enumerate(column[1:]):
            panel.plot(run.times_s * scale, run.responses[:, place], color=canvas.GREY, linewidth=0.8)
    for number, (label, shaper) in enumerate(shapers.items()):
        run = respond(modes, shaped_step(shaper, period_s, until_s), period_s)
        colour = canvas.COLOURS[number % len(canvas.COLOURS)]
        column[0].plot(run.times_s * scale, run.command, color=colour, linewidth=1.6, label=label)
        for place, panel in enumerate(column[1:]):
            panel.plot(run.times_s * scale, run.responses[:, place], color=colour, linewidth=1.4)
    column[0].set_ylabel("command")
    for panel, mode in zip(column[1:], modes, strict=True):
        panel.set_ylabel(f"{mode.frequency_hz:g} Hz")
    column[-1].set_xlabel(f"time in {unit}")
    _legend(column[0])
    canvas.heading(figure, "A step behind each shaper, and how the modes follow" + " (grey: unshaped)" * unshaped, "")
    canvas.save(figure, file)


def plot_branches(file: str | Path, branches: MinimalBranches, modes: Sequence[Mode]) -> None:
    """Durations of all minimal shapers of two modes over the frequency of the faster one, which a line marks.

    Args:
        file: ``.png`` or ``.svg``.
        branches: over the ratio to the slower mode.
        modes: the two.

    Raises:
        ValueError: a wrong ending.
        OSError: the file cannot be written.
    """
    slow, fast = sorted(mode.frequency_hz for mode in modes)
    figure = canvas.figure(9.0, 5.0)
    panel = canvas.panels(figure, 1, 1)[0][0]
    negative = (branches.amplitudes < 0.0).any(axis=2)
    durations_s = branches.times_s[..., 2]
    unit, scale = _time_unit(float(np.nanmax(durations_s)))
    for has, colour, label in ((True, canvas.COLOURS[0], "a negative tap"), (False, canvas.COLOURS[1], "none")):
        curves = np.where(negative == has, durations_s, np.nan)
        panel.plot(branches.ratios * slow, curves.T * scale, color=colour, linewidth=1.4)
        panel.plot([], [], color=colour, label=label)
    panel.axvline(fast, color=canvas.GREY, linewidth=0.8, linestyle="--")
    panel.set_ylim(bottom=0.0)
    panel.set_xlabel("frequency of the faster mode in Hz")
    panel.set_ylabel(f"duration in {unit}")
    _legend(panel)
    canvas.heading(figure, f"Minimal shapers of two modes, the slower one at {slow:g} Hz", "")
    canvas.save(figure, file)


def _legend(panel: Axes) -> None:
    panel.legend(loc="lower left", bbox_to_anchor=(0.0, 1.0), ncols=3, frameon=False, borderaxespad=0.2, fontsize=8)


def _time_unit(longest_s: float) -> tuple[str, float]:
    return ("s", 1.0) if longest_s >= 1.0 else ("ms", 1e3)


def _branches(result: Recommendation) -> MinimalBranches | None:
    """All minimal shapers of two modes around their ratio, the slower one held; None for another number of modes."""
    if len(result.bands) != 2:
        return None
    slow, fast = sorted((band.mode for band in result.bands), key=lambda mode: mode.frequency_hz)
    ratio = fast.frequency_hz / slow.frequency_hz
    lowest = max(_LEAST_RATIO, 0.6 * ratio)
    ratios = np.arange(lowest, max(1.4 * ratio, lowest + 0.2), _RATIO_STEP)
    # No more than the search takes at the largest ratio, and not more curves than one can tell apart.
    longest_s = min(
        result.options.max_duration_s, _BRANCH_SWINGS / slow.frequency_hz, 99.0 / (ratios[-1] * slow.frequency_hz)
    )
    branches = minimal_branches(slow, fast.damping_ratio, ratios.tolist(), longest_s)
    return branches if np.isfinite(branches.times_s).any() else None


def _modes(result: Recommendation) -> str:
    return ", ".join(map(str, result.bands))
