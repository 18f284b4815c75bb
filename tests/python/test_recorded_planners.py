"""Our models of LinuxCNC's and Klipper's planners beside what was recorded of them: residual vibration, block times.

Recordings: tests/benchmarks/data/recorded_planners.npz (its README says of what) and tests/golden/linuxcnc.
"""

from __future__ import annotations

import gzip
import json
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

from acceptance import machine_with
from dialect_readers import read_klipper
from judge import Mode, residual_um
from planner_references import PERIOD_S, distance_in_time, path_of_text, smoothed
from shapegcode import _core
from shapegcode.model.machine_model import fanuc_model

Array = NDArray[np.float64]
TESTS = Path(__file__).parents[1]
DATA = TESTS / "benchmarks" / "data" / "recorded_planners.npz"
LINUXCNC = TESTS / "golden" / "linuxcnc"
UNIT_MM = 1e-7
MODES = [[Mode(46.0, 0.02)], [Mode(131.0, 0.02)], []]
TWO_LINES = {"ramp_frequency_hz": 10_000.0, "kink_ratio": 0.7}
RECORDED = [
    f"{control}-paper-{program}-{acceleration}-{setting}"
    for control, setting in (("klipper", "host"), ("linuxcnc", "two-lines"), ("linuxcnc", "as-delivered"))
    for acceleration in (5_000, 10_000)
    for program in ("original", "shaped")
]


def modelled(path: _core.Path, kind: str, acceleration: float, settings: dict[str, Any]) -> Array:
    """Set-points of a path at 1 ms by our model of a control's planner."""
    axes = {f"axes.{axis}.max_acceleration_mm_s2": acceleration for axis in "xyz"}
    rates = {f"axes.{axis}.max_feed_mm_per_min": 30_000.0 for axis in "xyz"}
    own = {f"controller.{kind}": settings} if settings else {}
    model = fanuc_model(machine_with({**axes, **rates, "controller.kind": kind, **own}))
    followed, profile = _core.controlled_motion(path, model.limits, model.planner)
    points = np.asarray(_core.interpolate(followed, profile, PERIOD_S))
    return smoothed(points) if kind == "linuxcnc" else points


def klipper_path(text: str, folder: Path) -> _core.Path:
    """The moves between the last two dwells, as Klipper's own host reads them."""
    moves = read_klipper(text, folder)
    first, last = [k for k, move in enumerate(moves) if move.dwell_s][-2:]
    return _core.Path(
        [_core.Segment.line(each.start, each.end, each.feed_mm_per_min / 60.0) for each in moves[first + 1 : last]]
    )


def block_ends_s(points: Array, path: _core.Path) -> Array:
    """When set-points pass the ends of the blocks but the last, from the first that moves on."""
    moved = np.flatnonzero(np.any(np.diff(points, axis=0) != 0.0, axis=1))
    points = points[moved[0] : moved[-1] + 2]
    travel = np.concatenate([[0.0], np.cumsum(np.linalg.norm(np.diff(points, axis=0), axis=1))])
    ends = np.cumsum([each.length_mm for each in path])
    return np.interp(ends[:-1] * travel[-1] / ends[-1], travel, np.arange(len(travel)) * PERIOD_S)


def compare(recorded: Array, points: Array, path: _core.Path) -> tuple[Array, Array, float]:
    """Residual of X and Y of both, µm, and the largest difference of the block ends, s."""
    was = residual_um(recorded, MODES, PERIOD_S, still_mm=1e-7)[:2]
    by_model = residual_um(points, MODES, PERIOD_S, still_mm=1e-7)[:2]
    return was, by_model, float(np.abs(block_ends_s(recorded, path) - block_ends_s(points, path)).max())


@pytest.mark.parametrize("run", RECORDED)
def test_the_papers_path(run: str, tmp_path: Path) -> None:
    control, _, _, acceleration, setting = run.split("-", 4)
    with np.load(DATA) as file:
        recorded = np.cumsum(file[run], axis=0, dtype=np.int64) * UNIT_MM
        text = file[f"{run}-program"].tobytes().decode()
    if control == "klipper":
        path, settings = klipper_path(text, tmp_path), {}
    else:
        path = path_of_text(text, tmp_path)
        settings = {"rapid_follows": False, **(TWO_LINES if setting == "two-lines" else {})}
    points = modelled(path, control, float(acceleration), settings)
    was, by_model, late_s = compare(recorded, points, path)
    assert np.all(np.abs(by_model - was) <= 0.1 * was + 0.3)
    assert late_s <= PERIOD_S
    assert distance_in_time(recorded, points) < 1e-4


#: Where two segments overlap in LinuxCNC the model has one after the other. What holds there: difference of the
#: residual as a share of the recorded one and in µm, of the block ends in periods.
LESS_EXACT = {
    "short-original-10000-delivered": (0.1, 3.0, 1.0),  # Y: 0.9 µm recorded, 3.4 by the model; X: 108.0, 108.1
    "arcs-original-10000-delivered": (0.2, 0.3, 2.0),  # X: 15.4 µm recorded, 13.0 by the model; a block 1.6 ms early
}


@pytest.mark.parametrize("run", [each["run"] for each in json.loads((LINUXCNC / "runs.json").read_text())])
def test_other_paths(run: str, tmp_path: Path) -> None:
    found = next(each for each in json.loads((LINUXCNC / "runs.json").read_text()) if each["run"] == run)
    with gzip.open(LINUXCNC / f"{run}.csv.gz", "rt") as file:
        recorded = np.loadtxt(file, delimiter=",")
    path = path_of_text((LINUXCNC / f"{found['program']}.ngc").read_text(), tmp_path)
    settings = {"rapid_follows": False, **({} if found["as_delivered"] else TWO_LINES)}
    points = modelled(path, "linuxcnc", float(found["acceleration"]), settings)
    was, by_model, late_s = compare(recorded, points, path)
    share, more_um, periods = LESS_EXACT.get(run, (0.1, 0.3, 1.0))
    assert np.all(np.abs(by_model - was) <= share * was + more_um)
    assert late_s <= periods * PERIOD_S
