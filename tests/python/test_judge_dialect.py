"""The dialect's judge itself: places worked out by hand, brute force for compensation, alarms."""

import itertools
import math
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from judge.dialect import Alarm, Item, play
from shapegcode.io.units import FloatArray

DIALECT = Path(__file__).parents[1] / "golden" / "dialect"
NAMES = sorted(path.stem for path in DIALECT.glob("*.nc"))
HEAD = "%\nO1\nG21G17G90G94\nG0X0Y0Z0\n"


def moves_of(name: str, **settings: Any) -> list[Item]:
    return play((DIALECT / f"{name}.nc").read_text(), **settings)


def ends(items: list[Item], *kinds: str) -> list[tuple[float, ...]]:
    return [tuple(float(v) for v in np.round(i.end, 4) + 0.0) for i in items if i.kind in (kinds or ("line", "arc"))]


def run(body: str, **settings: Any) -> list[Item]:
    return play(HEAD + body + "\nM30\n%\n", **settings)


def samples(item: Item, count: int = 60) -> FloatArray:
    """Points of a move in its plane."""
    s = np.linspace(0.0, 1.0, count)[:, None]
    a, b = item.flat(item.start), item.flat(item.end)
    if item.kind != "arc":
        return np.asarray(a + s * (b - a))
    assert item.centre is not None
    centre = item.flat(item.centre)
    angle = math.atan2(*(a - centre)[::-1]) + s[:, 0] * item.sweep
    return np.asarray(centre + item.radius * np.column_stack([np.cos(angle), np.sin(angle)]))


def test_every_program_is_played() -> None:
    assert len(NAMES) >= 40
    for name in NAMES:
        items = moves_of(name)
        assert len(items) > 5, name
        for a, b in itertools.pairwise(items):
            # What ends somewhere begins there again, unless offsets changed in between or nobody knows.
            if not np.any(np.isnan(a.end + b.start)) and "G10" not in name and a.line == b.line:
                assert np.allclose(a.end, b.start, atol=1e-9), (name, a, b)


def test_bolt_circle() -> None:
    bottoms = [e for e in ends(moves_of("bolt_circle_g65"), "line")]
    assert len(bottoms) == 7
    for k, (x, y, z) in enumerate(bottoms):
        angle = math.radians(15.0 + k * 360.0 / 7.0)
        assert (x, y, z) == pytest.approx((40 + 25 * math.cos(angle), 30 + 25 * math.sin(angle), -12), abs=6e-4)


def test_repeats_of_subprograms() -> None:
    lines = ends(moves_of("subprogram_repeats"), "line")
    # Three of O1000, each a step further; two of it at Y50; five of O1100 at Y80 in place; O1000 once more.
    assert [(x, y) for x, y, _ in lines[::3]] == [
        (0, 0), (12.5, 0), (25, 0), (0, 50), (12.5, 50), *[(0, 80)] * 5, (0, 80)
    ]  # fmt: skip


def test_parametric_ellipse() -> None:
    for x, y, _ in ends(moves_of("ellipse"), "line")[1:]:
        assert (x / 30) ** 2 + (y / 18) ** 2 == pytest.approx(1.0, abs=1e-4)


def test_vacant_words_vanish() -> None:
    assert ends(moves_of("vacant"), "line") == [
        (1, 5, 1), (0, 5, 1), (10, 5, 1), (20, 5, 1), (30, 5, 1), (30, 30, 1), (30, 7, 1)
    ]  # fmt: skip


def test_argument_lists() -> None:
    assert ends(moves_of("arguments_one_and_two"), "line") == [
        (5, 7, 10), (0, 0, 10), (9, 0, 10),
        (3, 2, 10), (0, 0, 10), (0, 0, 10),
        (12, 17, 10), (0, 0, 10), (9, 12, 10),
        (0, 0, 10), (75, 101, 10), (0, 101, 10),
    ]  # fmt: skip


def test_computed_words_are_rounded_one_by_one() -> None:
    lines = ends(moves_of("rounding"), "line")
    assert lines[8] == (29.997, 1.287, 5.0)
    assert lines[9:] == [(0.667, -0.667, 5), (12.346, -0.667, 5), (10, -0.667, 5)]


def test_computed_codes_and_functions() -> None:
    items = moves_of("computed_codes")
    assert [i.kind for i in items[1:6]] == ["rapid", "line", "line", "line", "arc"]
    assert ends(items)[4:] == [(20, 8, -2), (10.5, 5, -2), (3, 1, -2), (2, 10, -2), (5, 9, 6)]


def test_locals_belong_to_a_call() -> None:
    assert ends(moves_of("nested_macros"), "line") == [
        (1, 0, 10), (1, 2, 10), (8, 2, 10), (6.5, 2, 10), (2, 6, 10), (1, 2, 10), (7, 6, 10)
    ]  # fmt: skip


def test_returns_to_a_sequence_number() -> None:
    lines = ends(moves_of("m99_jumps"), "line")
    assert lines == [(0, 5, 10), (20, 5, 10), (20, 10, 10), (20, 10, 10), (20, 15, 10), (20, 15, 10)]


def test_rotation_mirror_and_scaling() -> None:
    turned = [i for i in moves_of("rotated_pattern") if i.kind == "arc"]
    assert len(turned) == 12
    for k, arc in enumerate(turned[::2]):
        angle = math.radians(60.0 * k)
        centre = 10 + 35 * math.cos(angle) - 2 * math.sin(angle), 5 + 35 * math.sin(angle) + 2 * math.cos(angle)
        assert tuple(arc.centre[:2]) == pytest.approx(centre, abs=1e-9)
        assert arc.sweep == pytest.approx(math.pi)
    arcs = [i for i in moves_of("mirrored_g51_1") if i.kind == "arc"]
    assert [round(math.copysign(1, a.sweep)) for a in arcs] == [-1, 1, 1, -1, -1, 1, 1, -1]
    assert [tuple(np.round(a.end[:2], 6)) for a in arcs[::2]] == [(40, -10), (-30, -10), (-30, 0), (40, 0)]
    arcs = [i for i in moves_of("scaled_pocket") if i.kind == "arc"]
    assert [round(a.radius, 9) for a in arcs] == [10, 5, 20]
    assert [tuple(np.round(a.end[:2], 6)) for a in arcs] == [(40, 10), (30, 10), (80, 20)]


def test_polar_holes() -> None:
    holes = [e for e in ends(moves_of("polar_bolt_circle"), "line")]
    assert len(holes) == 3 + 8
    assert holes[1][:2] == pytest.approx((50 * math.cos(math.radians(150)), 25.0), abs=1e-4)
    assert holes[-1][:2] == pytest.approx(
        (35 * math.cos(math.radians(315)), 35 * math.sin(math.radians(315))), abs=1e-4
    )


def test_offsets_shift_what_is_not_programmed() -> None:
    assert ends(run("G52X5.\nG1Y1.F100."))[0] == (-5, 1, 0)
    assert ends(run("G10L2P1X10.\nG0X0Y0\nG91G10L2P1X2.\nG90G1Y1.F100."))[0] == (-2, 1, 0)
    shifted = run("G55G1Y1.F100.", work_offsets={"G54": (1.0, 2.0, 3.0), "G55": (11.0, 2.0, 0.0)})
    assert ends(shifted)[0] == (-10, 1, 3)


def test_feeds() -> None:
    inverse = [i.feed for i in moves_of("inverse_time") if i.kind == "line"]
    assert inverse == pytest.approx([100, 60, 240, 4 * math.hypot(10, 20), 300])
    assert run("G93G3X-10.I-5.F6.")[-1].feed == pytest.approx(30.0), "an arc's inverse time counts in its radius"
    per_turn = [i.feed for i in moves_of("feed_per_revolution") if i.feed == i.feed]
    assert per_turn == pytest.approx([80, 200, 200, 300, 200])


def test_peck_drilling() -> None:
    body = "G0Z20.\nG98G83X1.Y2.Z-10.R1.Q5.P300F50\nG80"
    levels = [(i.kind, float(i.end[2])) for i in run(body)[2:]]
    assert levels == [
        ("rapid", 20), ("rapid", 1), ("line", -4), ("rapid", 1), ("rapid", -3.5), ("line", -9), ("rapid", 1),
        ("rapid", -8.5), ("line", -10), ("dwell", -10), ("rapid", 20),
    ]  # fmt: skip


def test_holes_in_a_row_keep_their_levels() -> None:
    holes = ends(moves_of("drilled_row"), "line")
    assert holes[:6] == [(10 + 15 * k, 10, -9) for k in range(6)]
    # K0 only keeps the data: the tool does not go to Y80.
    assert holes[-2:] == [(20, 48, -5), (40, 48, -5)]


@pytest.mark.parametrize(
    ("name", "radius"),
    [
        ("g41_outer_square", 5.0), ("g42_inner_pocket", 3.975), ("g41_arcs", 3.0), ("g41_sharp_corners", 6.0),
        ("g42_arc_corners", 2.5), ("g41_corner_words", 4.0), ("mirrored_compensation", 3.0),
        ("rotation_and_scaling", 2.0), ("z_move_in_compensation", 5.0),
    ],
)  # fmt: skip
def test_the_tool_touches_the_contour_and_never_cuts_it(name: str, radius: float) -> None:
    """Against the same program with D0: the distance of the tool's centre from the contour is the radius, and
    larger only on the joins of outer corners."""
    text = (DIALECT / f"{name}.nc").read_text()
    contour = [i for i in play(with_radius_zero(text)) if i.kind in ("line", "arc") and i.moves_in_plane]
    tool = [i for i in play(text) if i.kind in ("line", "arc") and i.moves_in_plane]
    on_part = np.vstack([samples(i, 4000) for i in contour[1:-1]])
    touching = 0
    for item in tool[1:-1]:
        points = samples(item, 40)
        gap = np.array([np.min(np.hypot(*(on_part - p).T)) for p in points])
        assert np.min(gap) > radius - 1e-3, (name, item.line)
        assert np.max(gap) < radius * math.sqrt(2.0) + 1e-3, (name, item.line)
        touching += int(np.sum(gap < radius + 1e-3))
    assert touching > 20 * len(contour)
    # Start-up and end lie on the normals (type A).
    pairs = [(tool[0].flat(tool[0].end), contour[1].start), (tool[-1].flat(tool[-1].start), contour[-2].end)]
    for point, begin in pairs:
        assert np.hypot(*(point - contour[1].flat(begin))) == pytest.approx(radius, abs=1e-9)


def with_radius_zero(text: str) -> str:
    lines = []
    for line in text.split("\n"):
        lines.append(line.partition("R")[0] + "R0" if line.startswith("G10L1") else line)
    return "\n".join(lines)


@pytest.mark.parametrize(
    ("body", "alarm"),
    [
        ("#1=1/0", 112), ("#1=SQRT[-1]", 119), ("#1=[[[[[[1]]]]]]", 118), ("#0=1", 116), ("#50=1", 115),
        ("GOTO99", 128), ("WHILE[1EQ1]DO1\n#1=1", 124), ("WHILE[1EQ1]DO4\nEND4", 126), ("G65P77", 78), ("M98P77", 78),
        ("X1.#1=2", 127), ("G65P1", 122), ("M98P1", 77), ("#3000=5(STOP)", 3005), ("G1X1.", 11), ("G2X1.Y1.F9.", 22),
        ("G83X1.Z-1.R1.F9.", 45), ("G999", 10),
    ],
)  # fmt: skip
def test_alarm(body: str, alarm: int) -> None:
    with pytest.raises(Alarm) as caught:
        run(body)
    assert caught.value.alarm == alarm
