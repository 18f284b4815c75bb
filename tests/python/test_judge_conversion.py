"""Tests of the judge's verdict on conversions, good and bad ones."""

import math
from collections.abc import Callable
from typing import Any

import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings, strategies as st

from judge import Move, interpret, regions, split, verify_conversion
from judge.generate import programs
from judge.samples import SAMPLES, centre_of, read_sample

RANDOM = settings(max_examples=80, deadline=None, suppress_health_check=list(HealthCheck))


def chop(text: str, largest_sweep: float = math.radians(80.0), **options: Any) -> str:
    """A converter that shapes nothing: it halves lines, cuts arcs into pieces and restores all modes."""
    original = interpret(text, **options)
    inside = {n for a, b in regions(original) for n in range(a, b + 1)}
    out: list[str] = []
    for record in original.lines:
        if record.number not in inside or not record.moves:
            out.append(record.text)
            continue
        out.extend(chopped(record, largest_sweep))
    return "\n".join(out)


def chopped(record: Any, largest_sweep: float) -> list[str]:
    """One cutting line as several lines."""
    move: Move = record.moves[0]
    inch = record.modal["units"] == "G20"
    unit, digits = (25.4, 4) if inch else (1.0, 3)
    keep = " ".join(a + v for a, v in record.words if a in "NF")
    codes = " ".join(g for g in record.g_codes if g not in ("G00", "G01", "G02", "G03", "G09"))
    pieces = 2 if move.sweep is None else max(2, math.ceil(abs(move.sweep) / largest_sweep))
    at = np.zeros(3)
    lines: list[str] = []
    for k in range(1, pieces + 1):
        to = np.round(move.offsets(k / pieces)[0] / unit, digits) * unit if k < pieces else move.delta
        step, at = to - at, to
        words = []
        for i, axis in enumerate("XYZ"):
            value = step[i] if record.modal["distance"] == "G91" else move.start[i] + to[i]
            if abs(step[i]) > 1e-9:
                words.append(f"{axis}{value / unit:.{digits}f}")
        code = "G01"
        if move.kind == "arc" and move.normal_axis is not None and move.radius is not None:
            chord = math.hypot(*np.delete(step, move.normal_axis))
            if chord > 0.1:
                code = record.modal["motion"]
                words.append(f"R{math.ceil(move.radius / unit * 10**digits + 1) / 10**digits:.{digits}f}")
        if words or k == 1:
            head = [keep, codes] if k == 1 else []
            lines.append(" ".join([*[w for w in head if w], code, *words]))
    if code != record.modal["motion"]:
        lines.append(record.modal["motion"])
    return lines


def check_acquittal(text: str) -> None:
    assert verify_conversion(text, chop(text), contour_tolerance_um=60.0) == []
    ranges = regions(interpret(text))
    assert verify_conversion(text, chop(text), ranges) == []


@settings(RANDOM, max_examples=25)
@given(programs())
def test_a_faithful_conversion_is_acquitted(text: str) -> None:
    check_acquittal(text)


test_many_faithful_conversions_are_acquitted = pytest.mark.slow(RANDOM(given(programs())(check_acquittal)))


@pytest.mark.parametrize(
    "name",
    [pytest.param(name, marks=pytest.mark.slow) if name in ("BOTTLE.NC", "PARALLEL.NC") else name for name in SAMPLES],
)
def test_faithful_conversion_of_the_samples(name: str) -> None:
    text = read_sample(name)
    emitted = chop(text, arc_centre=centre_of(name))
    assert verify_conversion(text, emitted, arc_centre=centre_of(name), contour_tolerance_um=10.0) == []


BASE = """%
O0001
G21 G17 G90 G94 G64
T1 M6
G54
S1000 M3
G0 X0 Y0
G43 H1 Z5. M8
(POCKET)
N10 G1 Z-1. F100.
N20 X20. F6000.
(ARC)
N30 G3 X40. Y20. R20.
N40 G9 G1 Y40.
N50 X50.

N60 G0 Z5.
G4 P500
M5
G91 G28 Z0
M30
%
"""
GOOD = chop(BASE)


def swap(old: str, new: str) -> Callable[[str], str]:
    def change(text: str) -> str:
        assert text.count(old) == 1, (old, text)
        return text.replace(old, new)

    return change


def test_the_base_conversion_is_good() -> None:
    assert verify_conversion(BASE, GOOD, contour_tolerance_um=20.0) == []
    assert "N30 G03 X34.142 Y5.858 R20.001" in GOOD


@pytest.mark.parametrize(
    ("change", "letters"),
    [
        (swap("G4 P500\n", ""), "a"),
        (swap("G4 P500\n", "G04 P500\n"), "a"),
        (swap("M5\n", "M5 \n"), "a"),
        (swap("M5\n", "M5\r\n"), "a"),
        (swap("(ARC)\n", ""), "a"),
        (swap("(POCKET)\n", ""), "a"),
        (swap("G4 P500\n", "(HELLO)\nG4 P500\n"), "a"),
        (swap("\nM30\n%\n", "\nM30\n%"), "a"),
        (swap("N60 G0 Z5.", "F300.\nN60 G0 Z5."), "b"),
        (swap("N60 G0 Z5.", "G2\nN60 G0 Z5."), "b"),
        (swap("N60 G0 Z5.", "G18\nN60 G0 Z5."), "b"),
        (swap("N60 G0 Z5.", "G91\nN60 G0 Z5."), "b"),
        (swap("N60 G0 Z5.", "G61\nN60 G0 Z5."), "b"),
        (swap("G01 X50.000", "G01 X50.002"), "be"),
        (swap("G01 X50.000", "G01 X50.000 F5"), "bc"),
        (swap("G03 X40.000 Y20.000 R20.001", "G03 X40.000 Y20.000 R-20.001"), "cg"),
        (swap("N30 G03 X34.142 Y5.858 R20.001", "N30 G03 X34.142 Y5.858 I0 J20.008"), "c"),
        (swap("N30 G03", "G03"), "d"),
        (swap("G01 Y40.000", "N40 G01 Y40.000"), "d"),
        (swap("N20 F6000.", "N21 F6000."), "d"),
        (swap("G01 X50.000", "G01 XNAN"), "e"),
        (swap("G01 Y40.000\nN50 G01 X45.000", "G01 Y39.990\nN50 G01 X45.000 Y40.000"), "f"),
        (swap("N30 G03 X34.142 Y5.858 R20.001", "N30 G02 X34.142 Y5.858 R20.001"), "g"),
        (swap("N30 G03 X34.142 Y5.858 R20.001", "N30 G01 X34.142 Y5.858"), "g"),
    ],
)
def test_a_spoilt_conversion_is_convicted(change: Callable[[str], str], letters: str) -> None:
    found = verify_conversion(BASE, change(GOOD), contour_tolerance_um=20.0)
    assert {c[1] for c in found} == set(letters), found


def test_vanished_cutting_lines() -> None:
    strong, gaps = split(interpret(BASE))
    run = next(g for g in gaps if g.run)
    text = BASE
    for record in run.run:
        text = text.replace(record.text + "\n", "", 1)
    assert any(c.startswith("(e)") for c in verify_conversion(BASE, text))
    assert len(gaps) == len(strong) + 1


def test_lines_outside_the_ranges_stay() -> None:
    first = BASE.split("\n").index("N20 X20. F6000.") + 1
    found = verify_conversion(BASE, GOOD, [(first, first + 4)])
    assert found and all("outside the shaped ranges" in c or "before a region" in c for c in found)
    assert any("outside every region" in c for c in verify_conversion(BASE, GOOD, []))


def test_drift_from_an_unknown_origin_is_compared() -> None:
    text = "G91\nG0 X1.\nG1 X10. F100.\nY5.\nG0 X3.\nM30"
    good = text.replace("G1 X10. F100.\nY5.", "G1 X4. F100.\nX6.\nY5.")
    assert verify_conversion(text, good) == []
    bad = good.replace("X6.", "X6.002")
    assert {c[1] for c in verify_conversion(text, bad)} == {"b", "e"}


@RANDOM
@given(programs(), st.data())
def test_a_lost_line_is_noticed(text: str, data: st.DataObject) -> None:
    """Whatever strong line or last piece of a run is dropped from a good conversion, the judge says so."""
    emitted = chop(text).split("\n")
    strong, gaps = split(interpret("\n".join(emitted)))
    numbers = [r.number for r in strong]
    for gap in gaps:
        pieces = [r for r in gap.run if r.moves and np.abs(r.moves[0].delta).max() > 0.01]
        if pieces and pieces[-1] is gap.run[-1] and pieces[-1].modal["distance"] == "G91":
            numbers.append(pieces[-1].number)
    i = data.draw(st.sampled_from(numbers))
    assert verify_conversion(text, "\n".join(emitted[: i - 1] + emitted[i:]))
