"""The pictures of ``shapegcode shaper``: what the designs cost, what they leave, and what they do to a step."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from functools import partial
from typing import TYPE_CHECKING

import numpy as np

from shapegcode._core import MinimalBranches, Mode, Shaper, minimal_branches
from shapegcode.results import plot
from shapegcode.results.result import Plot
from shapegcode.shaping.bands import ModeBand, mode_band
from shapegcode.shaping.designs import Design
from shapegcode.shaping.result import Recommendation, times_name
from shapegcode.shaping.shaper_plots import draw_branches, draw_impulses, draw_sensitivity, draw_steps

if TYPE_CHECKING:
    from matplotlib.axes import Axes

__all__ = [
    "plot_branches", "plot_impulses", "plot_pareto", "plot_sensitivity", "plot_steps", "plots_of", "selected",
]  # fmt: skip

_CURVES = 6
_LEAST_RATIO = 1.02
_RATIO_STEP = 0.02
_BRANCH_SWINGS = 1.0  # of the slower mode: minimal shapers of interest are shorter


def plots_of(result: Recommendation) -> dict[str, Plot]:
    """Its pictures by name; the branches only for two modes that have some."""
    found: dict[str, Plot] = {
        "shaper-pareto": partial(plot_pareto, result),
        "shaper-sensitivity": partial(plot_sensitivity, result),
        "shaper-impulses": partial(plot_impulses, result),
        "shaper-steps": partial(plot_steps, result),
    }
    branches = _branches(result)
    if branches is not None:
        found["shaper-branches"] = partial(draw_branches, branches, [band.mode for band in result.modes])
    return found


def selected(result: Recommendation, count: int = _CURVES) -> list[Design]:
    """The designs worth a curve: what is recommended, then one of each family on the Pareto front, from short to long.

    Where there is room, one of each other family. Designs with negative taps are left out where they may not be
    recommended and there are others.
    """
    places = list(dict.fromkeys(each for each in (result.recommended, result.recommended_on_grid) if each is not None))
    negative = result.allow_negative or result.design.negative
    shown = [place for place in result.shown() if negative or not result.designs[place].negative]
    families = {result.designs[place].family for place in places}
    drawn = {_taps(result.designs[place]) for place in places}
    for pareto in (True, False):
        others = []
        for place in shown:
            each = result.designs[place]
            if each.pareto == pareto and each.family not in families and _taps(each) not in drawn:
                families.add(each.family)
                drawn.add(_taps(each))
                others.append(place)
        room = min(count - len(places), len(others))
        places += [others[round(step)] for step in np.linspace(0, len(others) - 1, room)] if room > 0 else []
    return [result.designs[place] for place in places]


def _taps(each: Design) -> tuple[float, ...]:
    """Times and amplitudes, to nine digits."""
    return tuple(float(f"{value:.9g}") for value in (*each.shaper.times_s, *each.shaper.amplitudes))


def _named(result: Recommendation) -> dict[str, Shaper]:
    """The shapers worth a curve by their names in a legend."""
    return {
        f"{each.family}, {each.duration_s * 1e3:.4g} ms"
        + (f" ({times_name(each.period_s)})" if each.period_s is not None else ""): each.shaper
        for each in selected(result)
    }


def plot_pareto(result: Recommendation, ax: Axes | None = None) -> Axes:
    """What does less vibration cost? Worst residual and contour cost over duration.

    Designs on the Pareto front are filled, what is recommended is ringed.

    Args:
        result: the comparison.
        ax: whose place is divided; None: a new figure.

    Returns:
        The upper panel.
    """
    rows = plot.grid(
        ax, 2, 1, size_inch=(9.0, 7.0), sharex="col", part=", ".join(map(str, result.modes)),
        title="Duration against what is left: filled = Pareto front, ringed = recommended",
    )  # fmt: skip
    upper, lower = (row[0] for row in rows)
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
    lower.set_ylabel("|σ²| in ms²: µm on R20 at 200 mm/s")
    lower.set_xlabel("duration in ms")
    plot.legend_below(lower, of=upper, columns=5)
    return upper


def plot_sensitivity(
    result: Recommendation | Shaper | Mapping[str, Shaper],
    ax: Axes | None = None,
    *,
    modes: Sequence[float | str | Mode | ModeBand] = (),
) -> Axes:
    """Residual vibration over the frequency of a mode.

    Args:
        result: a comparison (one curve for each of `selected`, the limit dashed), a shaper, or shapers by name.
        modes: of shapers, to be marked: as `choose_shaper` takes them; empty: undamped, up to two periods per shaper
            duration.
        ax: where to draw; None: a new figure.

    Returns:
        The axes that were drawn into.
    """
    if isinstance(result, Recommendation):
        return draw_sensitivity(_named(result), result.modes, result.vibration_limit, ax)
    shapers = {"shaper": result} if isinstance(result, Shaper) else dict(result)
    return draw_sensitivity(shapers, [mode_band(each) for each in modes], None, ax)


def plot_impulses(result: Recommendation, ax: Axes | None = None) -> Axes:
    """Which taps have they? One panel for each of `selected`.

    Args:
        result: the comparison.
        ax: whose place is divided; None: a new figure.

    Returns:
        The upper panel.
    """
    return draw_impulses(_named(result), ax)


def plot_steps(result: Recommendation, ax: Axes | None = None) -> Axes:
    """What becomes of a step, and how do the modes follow? One curve for each of `selected`.

    Args:
        result: the comparison.
        ax: whose place is divided; None: a new figure.

    Returns:
        The upper panel.
    """
    return draw_steps(_named(result), [band.mode for band in result.modes], ax)


def plot_branches(result: Recommendation, ax: Axes | None = None) -> Axes:
    """How long are the minimal shapers if the faster of two modes is another one?

    Args:
        result: a comparison for two modes.
        ax: where to draw; None: a new figure.

    Returns:
        The axes that were drawn into.

    Raises:
        ValueError: another number of modes, or no minimal shaper within the longest duration.
    """
    branches = _branches(result)
    if branches is None:
        raise ValueError(f"{len(result.modes)} modes have no branches to draw: there are some of two")
    return draw_branches(branches, [band.mode for band in result.modes], ax)


def _branches(result: Recommendation) -> MinimalBranches | None:
    """All minimal shapers of two modes around their ratio, the slower one held; None for another number of modes."""
    if len(result.modes) != 2:
        return None
    slow, fast = sorted((band.mode for band in result.modes), key=lambda mode: mode.frequency_hz)
    ratio = fast.frequency_hz / slow.frequency_hz
    lowest = max(_LEAST_RATIO, 0.6 * ratio)
    ratios = np.arange(lowest, max(1.4 * ratio, lowest + 0.2), _RATIO_STEP)
    # No more than the search takes at the largest ratio, and not more curves than one can tell apart.
    longest_s = min(result.max_duration_s, _BRANCH_SWINGS / slow.frequency_hz, 99.0 / (ratios[-1] * slow.frequency_hz))
    branches = minimal_branches(slow, fast.damping_ratio, ratios.tolist(), longest_s)
    return branches if np.isfinite(branches.times_s).any() else None
