"""Cells of docs/evidence/comparison.md by the judge, which reads, simulates and measures by code of its own."""

import functools
import re
from pathlib import Path

import numpy as np
import pytest

import acceptance
import shapegcode as sg
from judge import residual_um, response
from shapegcode.shaping import design, machine_bands
from test_judge_player import paper_path

TABLES = Path(__file__).parents[2] / "docs" / "evidence" / "comparison.md"
PAPER_PATH = Path(sg.__file__).parent / "data" / "paper_path.nc"
UNSHAPED = np.pad(paper_path(200.0, 0.0, 1e-3), ((0, 0), (0, 1)))  # as programmed
WIDE_UM = 1000.0  # contour tolerance that slows nothing


@functools.cache
def converted(family: str, contour: str = "off") -> acceptance.Judged:
    """The path of paper 000 at 200 mm/s, as the script of the tables converts it."""
    keys = {"shaping.family": family, "shaping.contour": contour, "tolerance.contour_um": WIDE_UM}
    return acceptance.convert(PAPER_PATH.read_text(), acceptance.machine_with(keys))


def judged(run: acceptance.Judged) -> acceptance.Figures:
    """What the judge measures of the last region, which holds the arc."""
    programmed, blocks, _ = list(run.regions())[-1]
    return acceptance.figures(run, blocks, programmed, "ceil")


def row(name: str) -> list[list[float]]:
    """The figures of a row of the first table, cell by cell."""
    text = TABLES.read_text(encoding="utf-8").split("PARALLEL.NC**")[0]
    (line,) = [line for line in text.splitlines() if line.startswith(f"| {name} ")]
    return [[float(figure) for figure in re.findall(r"[+-]?\d+\.?\d*", cell)] for cell in line.split("|")[2:-1]]


@pytest.mark.parametrize(("contour", "share"), [("off", 0.05), ("response", 0.1)])
def test_exact_shapers_leave_next_to_nothing_of_the_vibration_of_the_path(contour: str, share: float) -> None:
    run = converted("non-negative", contour)
    before = residual_um(UNSHAPED, run.modes, 1e-3)
    assert before[:2] == pytest.approx([row("as programmed")[2][0], row("as programmed")[3][0]], rel=0.02)
    assert (judged(run).residual[:2] < share * before[:2]).all()


@pytest.mark.parametrize("family", ["smooth-zv", "mirrored"])
def test_so_do_kernels_and_mirrored_taps(family: str) -> None:
    run = converted(family)
    before = residual_um(UNSHAPED, run.modes, 1e-3)
    assert (judged(run).residual[:2] < 0.05 * before[:2]).all()


def test_keeping_the_contour_makes_the_table_follow_the_path() -> None:
    plain, kept = judged(converted("non-negative")), judged(converted("non-negative", "response"))
    cells = row("`non-negative`: exact on the grid"), row("`non-negative`, contour kept ³")
    assert kept.response[0] < 0.25 * plain.response[0]
    for run, cell in zip((plain, kept), cells, strict=True):
        assert run.command[0] == pytest.approx(cell[5][0], rel=0.05)
        assert run.response[0] == pytest.approx(cell[6][0], rel=0.05)


def test_a_less_sensitive_shaper_cuts_the_arc_deeper() -> None:
    plain, robust = judged(converted("non-negative")), judged(converted("zvd"))
    assert robust.command[0] > 2.0 * plain.command[0]
    assert robust.command[0] == pytest.approx(row("`zvd`")[5][0], rel=0.05)


def test_the_minimal_shaper_loses_its_zeros_on_the_block_grid() -> None:
    note = next(line for line in TABLES.read_text(encoding="utf-8").splitlines() if line.startswith("¹"))
    shares = [float(share) / 100 for share in re.findall(r"([\d.]+) %", note)]
    ideal = design("minimal", machine_bands(sg.Machine.load("vx500")))[0].shaper
    for times, expected in ((ideal.times_s, shares[:2]), (np.round(ideal.times_s / 0.005) * 0.005, shares[2:])):
        for frequency_hz, share in zip((46.0, 131.0), expected, strict=True):
            # Each tap starts a decaying oscillation; what is left is their sum at the last one.
            pole = 2 * np.pi * frequency_hz * (-0.02 + 1j * np.sqrt(1 - 0.02**2))
            left = abs(np.sum(ideal.amplitudes * np.exp(pole * (times[-1] - times))))
            assert left == pytest.approx(share, abs=6e-4)


def test_the_judge_finds_the_vibration_of_the_path_as_programmed() -> None:
    _, command, table = response(UNSHAPED, [(46.0, 0.02), (131.0, 0.02), None], 1e-3)
    peak = 1e3 * np.abs(table - command).max(axis=0)
    assert peak[:2] == pytest.approx(row("as programmed")[4], rel=0.02)
