"""Feed schedules of random programs against a judge that shares no code with the scheduler: engagement from its
definition, a tool of discs, the feed that the machine really runs from the blocks of the written text."""

import math
from dataclasses import dataclass

import numpy as np
import pytest
import shapely

from judge.cutting import Cut, EndMill
from judge.engagement import Block, Material, layers_of, stations
from judge.feed_verdict import Control, Verdict, constant_feed_time, judge
from judge.feeds import Forces, Run, engagements, known
from judge.interpreter import interpret
from judge.milling_programs import Case, limits_toml, random_case
from shapegcode.cutting.stock import Stock
from shapegcode.cutting.tool import Tool
from shapegcode.feed.result import FeedSchedule
from shapegcode.feed.schedule import schedule_feed
from shapegcode.machine import Machine
from shapegcode.program import Program

FIGURE = {"resultant_n": "peak_n", "deflection_um": "deflection_um", "torque_nm": "torque_nm", "power_w": "power_w"}


@dataclass(frozen=True)
class Judged:
    """A scheduled program and what the judge found."""

    case: Case
    result: FeedSchedule
    verdict: Verdict
    met: list[Run]
    forces: Forces
    gain: float


def machine_and_control(name: str, time_constant_s: float | None, max_change: float | None) -> tuple[Machine, Control]:
    machine = Machine.load(name).with_values("feed_control.max_change_mm_per_min", max_change)
    if time_constant_s is not None:
        machine = machine.with_values("controller.time_constant_s", time_constant_s)
    controller = machine.controller
    after = controller.motion == "after_interpolation"
    return machine, Control(
        after,
        round(controller.time_constant_s / controller.interpolation_period_s) if after else 1,
        "ceil",
        controller.interpolation_period_s,
        machine.feed_control.interval_mm,
        machine.feed_control.max_change_mm_per_min or math.inf,
        machine.axes.x.max_feed_mm_per_min,
        controller.minimum_feed_mm_per_min,
    )


def judged(
    seed: int, kind: str, name: str, limited: str, *, feed: float = 300.0, rev_per_min: float | None = None,
    raised: float = 0.0, time_constant_s: float | None = None, max_change: float | None = None, step_mm: float = 0.4,
) -> Judged:  # fmt: skip
    """Schedules a random program with limits that are a share of what it takes as it is."""
    random = np.random.default_rng(seed)
    case = random_case(random, kind, feed=feed, rev_per_min=rev_per_min)
    machine, control = machine_and_control(name, time_constant_s, max_change)
    met = engagements(interpret(case.program), case.blocks, 0.5 * case.mill.diameter, step_mm=step_mm)
    forces = Forces(case.mill)
    mean = limited == "mean"
    now = [forces.along(run, np.array([move.feed for move in run.moves])[run.move]) for run in met]
    share = float(random.uniform(0.45, 0.8))
    for limit, column in FIGURE.items():
        if limited in (limit, "all") or (mean and limit == "resultant_n"):
            of = "mean_n" if mean else column
            case.limits[limit] = share * max(float(figures[of].max()) for figures in now)
    tool = case.tool_toml + limits_toml(case.limits, mean=mean, most=raised)
    result = schedule_feed(
        Program.from_text(case.program, machine), machine, Tool.from_toml(tool), Stock.from_toml(case.stock_toml)
    )
    verdict = judge(
        case, result.text.decode(), result.to_dict(), met, forces, control, mean=mean, max_feed=raised or math.inf,
        raised=raised > 0.0,
    )  # fmt: skip
    ceiling = min(raised, control.max_feed) if raised else feed
    constant = constant_feed_time(met, forces, case.limits, mean, ceiling)
    return Judged(case, result, verdict, met, forces, constant / verdict.emitted["time"])


def assert_good(of: Judged, *, near: float) -> None:
    """Limits, path, text and figures."""
    assert of.verdict.findings == []
    assert of.verdict.worst
    for limit, share in of.verdict.worst.items():
        assert share <= 1.0, f"{limit}: {of.verdict.place[limit]}"
    if of.verdict.limited_share > 0.05:
        assert of.verdict.near_share >= near
    assert of.gain >= 1.0 - 1e-3
    for when in ("original", "emitted"):
        reported, own = getattr(of.result.resultant_force_n, when), getattr(of.verdict, when)
        assert reported.mean == pytest.approx(own["mean"], rel=0.02)
        # A bound from above where the feed changes within a step of the engagement; of a look-ahead the judge takes the
        # F word at once, without acceleration.
        assert -0.03 <= reported.max / own["max"] - 1.0 <= 0.12
    blocks = of.result.blocks
    assert blocks.original == sum(1 for move in interpret(of.case.program).moves if move.is_cut and move.length > 0.0)
    assert blocks.emitted == sum(
        1 for move in interpret(of.result.text.decode()).moves if move.is_cut and move.length > 0.0
    )


QUICK = [
    (20, "outside", "vx500", "resultant_n", 0.6, {}),
    (302, "pocket", "vx500", "deflection_um", 0.7, {"raised": 1460.0}),
    (105, "inside", "kimm004", "torque_nm", 0.4, {}),
    (27, "island", "vx500", "mean", 0.7, {"max_change": 60.0}),
    (209, "inside", "kimm004", "resultant_n", 0.0,
     {"time_constant_s": 0.1, "feed": 2000.0, "rev_per_min": 8000.0}),
]  # fmt: skip


MORE = [
    (28, "outside", "vx500", "all", 0.6, {}),
    (25, "inside", "vx500", "resultant_n", 0.6, {}),
    # Arcs that begin where the load is largest.
    (9, "inside", "vx500", "power_w", 0.0, {}),
    (17, "inside", "kimm004", "mean", 0.0, {"feed": 600.0}),
    (6, "pocket", "vx500", "power_w", 0.5, {"feed": 600.0}),
    (302, "pocket", "kimm004", "resultant_n", 0.3, {"max_change": 60.0}),
    (106, "pocket", "kimm004", "mean", 0.3, {"raised": 560.0}),
    (204, "outside", "kimm004", "torque_nm", 0.3,
     {"time_constant_s": 0.1, "feed": 2000.0, "rev_per_min": 8000.0, "raised": 4689.0}),
    (202, "pocket", "kimm004", "resultant_n", 0.3,
     {"time_constant_s": 0.1, "feed": 2000.0, "rev_per_min": 8000.0}),
    (212, "outside", "kimm004", "deflection_um", 0.3,
     {"time_constant_s": 0.1, "feed": 2000.0, "rev_per_min": 8000.0}),
]  # fmt: skip


@pytest.mark.parametrize(
    ("seed", "kind", "machine", "limited", "near", "options"),
    [*QUICK, *(pytest.param(*each, marks=pytest.mark.slow) for each in MORE)],
)
def test_schedule_of_a_random_program(
    seed: int, kind: str, machine: str, limited: str, near: float, options: dict[str, float]
) -> None:
    assert_good(judged(seed, kind, machine, limited, **options), near=near)


def test_the_judge_meets_a_slot_a_half_and_a_wall() -> None:
    """Closed forms: full slot, a second slot half a diameter beside it, a wall of a given radial depth."""
    text = "G90 G17 F100.\nG00 X-20. Y0. Z-2.\nG01 X20.\n"
    text += "".join(f"G00 Z5.\nX-20. Y{y}\nZ-2.\nG01 X20.\n" for y in ("-4.", "9."))
    moves = known(interpret(text))
    blocks = [Block(shapely.box(-15.0, -30.0, 15.0, 12.0), -5.0, 0.0)]
    material = Material(blocks)
    found = []
    for move in moves:
        if move.is_cut:
            layers = layers_of(moves, blocks, 0.5)
            found.append(material.meet(move, 4.0, stations(move, 1.0, 4.0), layers))
        material.sweep(move, 4.0)
    middle = [next(met for met in run if abs(abs(met.s_mm) - 20.0) < 0.6) for run in found]
    (slot,) = middle[0].arcs
    assert slot == pytest.approx((-math.pi / 2, math.pi / 2, 0.0, 2.0), abs=0.04)
    (half,) = middle[1].arcs  # the tool runs in +X, material on its right
    assert half == pytest.approx((-math.pi / 2, 0.0, 0.0, 2.0), abs=0.04)
    (wall,) = middle[2].arcs  # from Y5 to Y12 of a tool from Y5 to Y13: left from -90 degrees to asin(3/4)
    assert wall == pytest.approx((-math.pi / 2, math.asin(0.75), 0.0, 2.0), abs=0.04)


def test_the_judge_forces_are_those_of_the_closed_form() -> None:
    """Straight flutes, constant coefficients: mean force of Altintas, mean torque and power, largest resultant."""
    mill = EndMill(10.0, 2, 0.0, 600.0, 0.0, 0.3, 0.0, 0.0, 0.0, True, 3000.0, 40.0, 25.0, 10.0, 8.0, 600.0)
    depth, feed = 3.0, 600.0
    per_tooth = feed / (2 * 3000.0)
    figures = Cut(mill, ((-math.pi / 2, math.pi / 2, 0.0, depth),)).figures(feed)
    mean_torque = 2 / (2 * math.pi) * 600.0 * depth * per_tooth * 2.0 * 5.0e-3
    assert figures.power_w == pytest.approx(mean_torque * 3000.0 * 2.0 * math.pi / 60.0, rel=2e-3)
    assert figures.torque_nm == pytest.approx(600.0 * depth * per_tooth * 5.0e-3, rel=2e-3)
    assert figures.peak_n == pytest.approx(600.0 * depth * per_tooth * math.hypot(1.0, 0.3), rel=2e-3)
    # A cantilever of two sections by hand, under the force at half the depth.
    height = np.array([0.5 * depth])
    inner = np.pi * 8.0**4 / 64.0 * 600e3
    outer = np.pi * 10.0**4 / 64.0 * 600e3

    def part(low: float, high: float) -> float:
        return (high**3 - low**3) / 3.0 - height[0] * (high**2 - low**2) / 2.0

    by_hand = 1e3 * (part(height[0], 25.0) / inner + part(25.0, 40.0) / outer)
    assert mill.tip_um_per_n(height)[0] == pytest.approx(by_hand, rel=1e-3)
