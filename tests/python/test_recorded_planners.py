"""Our models of LinuxCNC's and Klipper's planners beside recordings of them (tests/golden/linuxcnc, and
tests/benchmarks/data/recorded_planners.npz, whose README says of what): residual vibration, block times."""

import gzip
import json
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import shapegcode as sg
from dialect_readers import ReadMove, plan_klipper, read_klipper
from judge import residual_um
from planner_references import (
    ARC_MM,
    PERIOD_S,
    distance_in_time,
    klipper_text,
    path_of_text,
    smoothed,
    table_off_path_um,
)
from shapegcode import _core
from shapegcode.io.units import FloatArray
from shapegcode.machine.programs import ANY_PRICE
from test_planner_models import MODES, machine_of, planned

TESTS = Path(__file__).parents[1]
DATA = TESTS / "benchmarks" / "data" / "recorded_planners.npz"
LINUXCNC = TESTS / "golden" / "linuxcnc"
UNIT_MM = 1e-7
TWO_LINES = {"ramp_frequency_hz": 10_000.0, "kink_ratio": 0.7}
RECORDED = [
    f"{control}-paper-{program}-{acceleration}-{setting}"
    for control, setting in (("klipper", "host"), ("linuxcnc", "two-lines"), ("linuxcnc", "as-delivered"))
    for acceleration in (5_000, 10_000)
    for program in ("original", "shaped")
]


def modelled(path: _core.Path, kind: str, acceleration: float, settings: dict[str, Any]) -> FloatArray:
    """Set-points of a path at 1 ms by our model of a control's planner."""
    points, _ = planned(path, machine_of(kind, acceleration, **settings))
    return smoothed(points) if kind == "linuxcnc" else points


def klipper_cut(text: str, folder: Path, arc_mm: float | None = None) -> list[ReadMove]:
    """The moves between the last two dwells, as Klipper's own host reads them."""
    moves = read_klipper(text, folder, arc_mm)
    first, last = [k for k, move in enumerate(moves) if move.dwell_s][-2:]
    return moves[first + 1 : last]


def klipper_path(text: str, folder: Path) -> _core.Path:
    """The same as a path."""
    moves = klipper_cut(text, folder)
    return _core.Path([_core.Segment.line(each.start, each.end, each.feed_mm_per_min / 60.0) for each in moves])


def block_ends_s(points: FloatArray, path: _core.Path) -> FloatArray:
    """When set-points pass the ends of the blocks but the last, from the first that moves on."""
    moved = np.flatnonzero(np.any(np.diff(points, axis=0) != 0.0, axis=1))
    points = points[moved[0] : moved[-1] + 2]
    travel = np.concatenate([[0.0], np.cumsum(np.linalg.norm(np.diff(points, axis=0), axis=1))])
    ends = np.cumsum([each.length_mm for each in path])
    return np.interp(ends[:-1] * travel[-1] / ends[-1], travel, np.arange(len(travel)) * PERIOD_S)


def compare(recorded: FloatArray, points: FloatArray, path: _core.Path) -> tuple[FloatArray, FloatArray, float]:
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
    if control == "klipper" and "original" in run:
        path, settings = path_of_text(f"{text}M2\n", tmp_path), {}  # arcs, cut by [gcode_arcs] and by the model
    elif control == "klipper":
        path, settings = klipper_path(text, tmp_path), {}
    else:
        path = path_of_text(text, tmp_path)
        settings = {"rapid_follows": False, **(TWO_LINES if setting == "two-lines" else {})}
    points = modelled(path, control, float(acceleration), settings)
    was, by_model, late_s = compare(recorded, points, path)
    assert np.all(np.abs(by_model - was) <= 0.1 * was + 0.3)
    assert late_s <= PERIOD_S
    assert distance_in_time(recorded, points) < 1e-4


ARCS = {
    "paper": "G01X20.F12000.\nG03X40.Y20.R20.\nG01Y40.\n",
    "small arcs": "G01X5.F3000.\nG02X7.Y-2.R2.\nG03X9.Y-4.R2.\nG01Y-10.\n",
    "S": "G01X15.F9000.\nG02X25.Y-10.R10.\nG03X45.Y-30.R20.\nG01X45.Y-45.\n",
    "slot": "G01X20.F6000.\nG03X20.Y10.R5.\nG01X0.\nG03X0.Y0.R5.\nG01X20.\n",
    "large arc": "G01X20.F15000.\nG03X80.Y60.R60.\nG01Y80.\n",
}
MORE = [pytest.param(name, marks=pytest.mark.slow) for name in list(ARCS)[2:]]
WITHIN = {"tolerance.contour_um": 1e4, "tolerance.residual_floor_um": 1e4}  # of every cut, so that none is shaped


@pytest.mark.parametrize("acceleration", [5_000.0, 10_000.0])
@pytest.mark.parametrize("unchanged", [False, True], ids=["shaped", "unchanged"])
@pytest.mark.parametrize("name", ["paper", "small arcs", *MORE])
def test_a_verdict_on_arcs_is_that_of_klippers_host(
    name: str, unchanged: bool, acceleration: float, tmp_path: Path
) -> None:
    """What is emitted, and the original with G2 and G3 by [gcode_arcs], both at Klipper's defaults."""
    dialects = {"controller.dialect": "fanuc", "emission.dialect": "klipper"}
    limits = {**ANY_PRICE, **(WITHIN if unchanged else {})}
    machine = machine_of("klipper", acceleration).with_values({**dialects, **limits})
    text = f"G21G90\nG00X0.Y0.Z0.\nG04P500\n{ARCS[name]}G04P500\nM30\n"
    program = sg.Program.from_text(text, machine)
    conversion = sg.convert(program, machine, shape_all=not unchanged)
    assert len(conversion.placed) == (0 if unchanged else 1)
    path = program.regions[0].path
    emitted, original = klipper_cut(conversion.text.decode(), tmp_path), klipper_text(path)
    for side, cut in (("emitted", emitted), ("original", klipper_cut(original, tmp_path, ARC_MM))):
        points, time_s = plan_klipper(cut, acceleration, tmp_path)
        was = residual_um(points, MODES, PERIOD_S, still_mm=1e-7)[:2]
        residual = getattr(conversion.residual_vibration_um, side)
        assert np.all(np.abs(np.array([residual.x, residual.y]) - was) <= 0.1 * was + 0.3)
        _, table_um = table_off_path_um(points, np.asarray(path.polyline(0.002)), MODES)
        said_um = getattr(conversion.contour_error_um.response, side).max
        assert said_um == pytest.approx(table_um, rel=0.1, abs=0.3)
        assert getattr(conversion.cutting_time_s, side) == pytest.approx(time_s, abs=2.5 * PERIOD_S)
    # Whoever simulates or times the emitted program has the same chords.
    if not unchanged:
        run = sg.simulate(conversion.emitted, machine).regions[0]
        assert run.residual_vibration_um.x == pytest.approx(conversion.residual_vibration_um.emitted.x, abs=1e-6)
        assert run.time_s == pytest.approx(conversion.cutting_time_s.emitted, abs=1e-9)
        timed = sg.cycle_time(conversion.emitted, machine, full=True)
        assert timed.cycle_time_s == pytest.approx(conversion.cycle_time_s.emitted, abs=1e-9)
        assert timed.full_interpolation_s == pytest.approx(timed.cycle_time_s, abs=2.5 * PERIOD_S)


#: Where two segments overlap in LinuxCNC the model has one after the other. What holds there: difference of the
#: residual as a share of the recorded one and in µm, of the block ends in periods.
LESS_EXACT = {
    "short-original-10000-delivered": (0.1, 3.0, 1.0),  # Y: 0.9 µm recorded, 3.4 by the model; X: 108.0, 108.1
    "arcs-original-10000-delivered": (0.2, 0.3, 2.0),  # X: 15.4 µm recorded, 13.0 by the model; a block 1.6 ms early
}
#: Largest distance in time of the set-points, µm, and of the times, ms.
DISTANCE = {
    "paper-original-5000-delivered": (0.01, 0.0),
    "paper-shaped-5000-two-lines": (0.01, 0.0),
    "paper-shaped-10000-delivered": (0.01, 0.0),
    "paper-shaped-10000-two-lines": (0.01, 0.0),
    "corners-original-5000-delivered": (0.2, 0.0),
    "corners-original-10000-delivered": (80.0, 1.0),
    "short-original-5000-delivered": (2.0, 0.0),
    "short-original-10000-delivered": (15.0, 0.0),
    "short-original-10000-two-lines": (15.0, 0.0),
    "short-shaped-10000-two-lines": (0.01, 0.0),
    "arcs-original-10000-delivered": (150.0, 2.0),
    "arcs-original-5000-two-lines": (150.0, 2.0),
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
    if run in DISTANCE:
        limit_um, limit_ms = DISTANCE[run]
        assert distance_in_time(recorded, points) * 1e3 < limit_um
        ends = [np.flatnonzero(np.any(np.diff(each, axis=0) != 0.0, axis=1))[-1] for each in (recorded, points)]
        assert abs(int(ends[0]) - int(ends[1])) <= limit_ms + 3.0
