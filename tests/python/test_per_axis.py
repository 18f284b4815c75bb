"""A shaper for each axis: its filters against a linear program written out, and programs judged independently."""

from collections.abc import Sequence

import numpy as np
import pytest
from scipy.optimize import linprog

import shapegcode as sg
from acceptance import check_figures, convert, machine_with
from shapegcode._core import Mode, Shaper
from shapegcode.shaping.track import design_per_axis
from shaper_residual import left_of

PART = "%\nO1\nG21G17G90G94\nG54G00X0.Y0.\nG01X20.F12000\nG03X40.Y20.R20.\nG01Y40.\nG00X0.\nM30\n%\n"
MODES = (
    ([Mode(46.0, 0.02)], [Mode(131.0, 0.02)], []),
    ([Mode(30.0, 0.02), Mode(80.0, 0.02)], [Mode(45.0, 0.02), Mode(110.0, 0.02)], []),
    ([Mode(25.0, 0.0)], [], [Mode(60.0, 0.1)]),
)


def exists(axis_modes: Sequence[Sequence[Mode]], period_s: float, periods: int) -> bool:
    """Whether non-negative impulses at 0 ... `periods` with one mean cancel each axis' modes: one program for all."""
    shaken = [modes for modes in axis_modes if modes]
    n = periods + 1
    rows, right = [], []
    for index, modes in enumerate(shaken):
        place = np.zeros(len(shaken) * n + 1)
        place[index * n : (index + 1) * n] = 1.0
        rows.append(place.copy())
        right.append(1.0)
        place[index * n : (index + 1) * n] = np.arange(n)
        place[-1] = -1.0
        rows.append(place.copy())
        right.append(0.0)
        for mode in modes:
            terms = np.exp(mode.pole * period_s * (periods - np.arange(n)))
            for part in (terms.real, terms.imag):
                row = np.zeros(len(shaken) * n + 1)
                row[index * n : (index + 1) * n] = part
                rows.append(row)
                right.append(0.0)
    found = linprog(np.zeros(len(rows[0])), A_eq=np.array(rows), b_eq=right, bounds=(0, None), method="highs")
    return bool(found.status == 0)


@pytest.mark.parametrize("axis_modes", MODES)
@pytest.mark.parametrize("ms", [2, 4, 5])
def test_shortest_of_one_mean(axis_modes: Sequence[Sequence[Mode]], ms: int) -> None:
    period_s = ms * 1e-3
    firs = design_per_axis(axis_modes, period_s, 0.25)
    assert firs is not None and len(firs) == 3
    assert max(fir.mean_samples for fir in firs) - min(fir.mean_samples for fir in firs) < 1e-6
    assert min(min(fir.taps) for fir in firs) >= 0.0
    for fir, modes in zip(firs, axis_modes, strict=True):
        shaper = Shaper([(delay - fir.delays[0]) * period_s for delay in fir.delays], fir.taps)
        assert all(left_of(shaper, mode) < 1e-9 for mode in modes)
    longest = max(fir.duration_samples for fir, modes in zip(firs, axis_modes, strict=True) if modes)
    assert exists(axis_modes, period_s, longest)
    assert not exists(axis_modes, period_s, longest - 1)


def test_none_within_the_duration() -> None:
    assert design_per_axis(MODES[0], 0.005, 0.009) is None
    with pytest.raises(sg.ArgumentError, match="at least one mode"):
        design_per_axis(((), (), ()), 0.005, 0.1)
    with pytest.raises(sg.ArgumentError, match="period_s"):
        design_per_axis(MODES[0], 0.0, 0.1)


@pytest.mark.parametrize("target", ["response", "command"])
def test_program(target: str) -> None:
    common = convert(PART, machine_with({"shaping.contour": target}))
    judged = convert(PART, machine_with({"shaping.contour": target, "shaping.per_axis": True}))
    check_figures(judged, contour_budget_s=3.0)
    report = judged.conversion.to_dict()
    assert judged.conversion.ok
    assert report["shaper"]["duration_s"] == pytest.approx(0.015)
    assert common.conversion.to_dict()["shaper"]["per_axis_duration_s"] == pytest.approx(0.015)
    assert report["cutting_time_s"]["emitted"] < common.conversion.to_dict()["cutting_time_s"]["emitted"]


@pytest.mark.parametrize("keys", [{"shaping.contour": "off"}, {"shaping.family": "zvd"}])
def test_where_it_cannot_be(keys: dict[str, object]) -> None:
    with pytest.raises(sg.ArgumentError, match="per_axis"):
        sg.choose_grid(machine_with({**keys, "shaping.per_axis": True}))
