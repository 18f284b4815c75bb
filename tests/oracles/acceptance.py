"""Converts a program with the package and lets the judge, which shares no code with it, have the last word."""

from __future__ import annotations

import re
from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
import numpy.typing as npt

import shapegcode as sg
from judge import (
    Interpretation,
    Mode,
    Move,
    contour_error_um,
    durations,
    interpret,
    play,
    residual_um,
    response,
    samples,
    starts,
    verify_conversion,
)
from judge.player import BlockEnd
from shapegcode import _core
from shapegcode.machine.programs import ANY_PRICE

PROGRAMS = samples.PROGRAMS
SAMPLES = samples.SAMPLES
read_sample = samples.read_sample
BLOCK_ENDS: tuple[BlockEnd, ...] = ("ceil", "carry")
#: Settings that a sample needs to be read as it was meant.
SAMPLE_KEYS: dict[str, dict[str, Any]] = {"BOTTLE.NC": {"input.arc_centre": "absolute"}}
#: What the judges call the moves.
MOVE_KINDS = {_core.SegmentKind.rapid: "rapid", _core.SegmentKind.line: "line", _core.SegmentKind.arc: "arc"}
HEADER_LINE = re.compile(r"\([A-Z0-9 .-]{1,60}\)\r?")


def machine_with(keys: Mapping[str, Any] | None = None, base: str = "vx500") -> sg.Machine:
    """A built-in machine with other values for some dotted keys, on which shaping may cost any time."""
    return sg.Machine.load(base).with_values({**ANY_PRICE, **(keys or {})})


def moves_of(program: sg.Program) -> list[tuple[Any, float]]:
    """(segment, dwell) of every step in the order in which it happens, without those that lead nowhere."""
    core = program.core
    moves: list[tuple[Any, float]] = []
    for kind, index, _line in core.steps:
        if kind == _core.StepKind.region:
            path = core.regions[index].path
            moves += [(path[k], 0.0) for k in range(len(path))]
        elif kind == _core.StepKind.move:
            moves.append(core.other_moves[index])
    return [(segment, dwell) for segment, dwell in moves if dwell > 0.0 or segment.length_mm > 1e-9]


@dataclass(frozen=True)
class Judged:
    """A conversion as the judge sees it; texts are without the header comments of the converter."""

    conversion: sg.Conversion
    machine: sg.Machine
    original: str
    emitted: str
    header_lines: int

    def interpretation(self, text: str, *, emitted: bool) -> Interpretation:
        return interpret(
            text,
            calculator_decimal_point=self.machine.controller.calculator_decimal_point,
            arc_centre="incremental" if emitted else self.machine.input.arc_centre,
        )

    def regions(self) -> Iterator[tuple[list[Move], list[Move], Mapping[str, Any]]]:
        """Original moves, emitted moves and the report of every region."""
        ours = self.interpretation(self.original, emitted=False).lines
        theirs = self.interpretation(self.emitted, emitted=True).lines
        for entry in self.conversion.to_dict()["regions"]:
            first, last = entry["lines"]
            begin, end = (line - self.header_lines for line in entry["emitted_lines"])
            yield (
                [m for r in ours[first - 1 : last] for m in r.moves],
                [m for r in theirs[begin - 1 : end] for m in r.moves],
                entry,
            )

    @property
    def modes(self) -> list[list[Mode]]:
        return [
            [Mode(m.frequency_hz, m.damping_ratio, m.participation) for m in axis.modes]
            for axis in self.machine.axes.as_tuple()
        ]


def without_header(original: str, emitted: str, machine: sg.Machine) -> tuple[str, int]:
    """The emitted text without the comments that the converter put behind the O line, and how many they are."""
    ours, theirs = original.split("\n"), emitted.split("\n")
    if not machine.emission.header or original == emitted:
        return emitted, 0
    at = next(i for i, line in enumerate(theirs) if line.startswith("(SHAPEGCODE "))
    assert theirs[:at] == ours[:at]
    count = 0
    while "TIME CONSTANT" not in theirs[at + count]:
        count += 1
    count += 1
    for line in theirs[at : at + count]:
        assert HEADER_LINE.fullmatch(line), line
        assert line.endswith("\r") == ours[0].endswith("\r")
    assert any("OVERRIDE" in line for line in theirs[at : at + count])
    return "\n".join(theirs[:at] + theirs[at + count :]), count


def convert(text: str, machine: sg.Machine, **options: Any) -> Judged:
    """Convert, and hold the text against the original; every complaint of the judge is a failure.

    Every cut is shaped at any price, unless options say otherwise: what is held here is what shaping does.
    """
    options = {"shape_all": True, "max_time_increase_percent": 1e6, "max_cut_time_increase_percent": 1e6} | options
    program = sg.Program.from_text(text.encode("latin-1"), machine, source="part.nc")
    conversion = sg.convert(program, machine, **options)
    written = conversion.text.decode("latin-1")
    if "\n\r\r" in text:  # as punched; the judge reads LF
        assert written.count("\n") == written.count("\n\r\r")
        text, written = text.replace("\n\r\r", "\n"), written.replace("\n\r\r", "\n")
    emitted, header = without_header(text, written, machine)
    judged = Judged(conversion, machine, text, emitted, header)
    complaints = verify_conversion(
        text,
        emitted,
        [(e["lines"][0], e["lines"][1]) for e in conversion.to_dict()["regions"]],
        calculator_decimal_point=machine.controller.calculator_decimal_point,
        arc_centre=machine.input.arc_centre,
        contour_tolerance_um=contour_limit_um(machine, conversion.to_dict()),
        inserted=inserted_lines(machine),
    )
    assert not complaints, "\n".join(complaints[:10])
    return judged


def contour_limit_um(machine: sg.Machine, report: Mapping[str, Any]) -> float:
    """How far the texts may lie apart, either from the other; a missed corner lies further from the curve."""
    stated: float = report["contour_error_um"]["command"]["emitted"]["max"]
    return 2.0 * max(machine.tolerance.contour_um, stated) + 2.0


def inserted_lines(machine: sg.Machine) -> list[str]:
    lines = ["(SHAPED)", *machine.emission.prologue, *machine.emission.epilogue]
    if machine.emission.prefill_dwell_s > 0:
        lines.append(f"G04P{round(machine.emission.prefill_dwell_s * 1e3)}")
    return lines


def whole_periods(judged: Judged) -> None:
    """Under "ceil" every block of every region lasts a whole multiple of the block period."""
    period = judged.conversion.to_dict()["block_period_s"]
    tick = judged.machine.controller.interpolation_period_s
    for _, moves, entry in judged.regions():
        cuts = [m for m in moves if m.length > 0.0]
        if not cuts:
            continue
        times = durations(cuts, period_s=tick, block_end="ceil")
        off = np.abs(times / period - np.round(times / period))
        worst = int(off.argmax())
        assert off[worst] < 1e-6, f"{entry['lines']}: block {cuts[worst]} lasts {times[worst] * 1e3:g} ms"


@dataclass(frozen=True)
class Figures:
    """What the judge measures of a run of blocks, µm; contour errors (largest, RMS) are those at the ticks."""

    residual: npt.NDArray[np.float64]
    command: tuple[float, float] = (0.0, 0.0)
    response: tuple[float, float] = (0.0, 0.0)


def figures(
    judged: Judged,
    blocks: list[Move],
    programmed: list[Move],
    rule: BlockEnd,
    *,
    contour: bool = True,
    override: float = 1.0,
) -> Figures:
    """Play the emitted blocks of a region and measure them against the programmed moves."""
    tick = judged.machine.controller.interpolation_period_s
    filter_ticks = round(judged.machine.controller.shaped_time_constant_s / tick)
    cuts = [m for m in blocks if m.length > 0.0]
    if not cuts:
        return Figures(np.zeros(3))
    points = play(cuts, period_s=tick, block_end=rule, acceleration_samples=filter_ticks, override=override)
    # From an unknown origin both count from zero; a known start is the same to within its rounding.
    points = points + (np.round(starts(programmed)[0] - points[0], 2))
    residual = residual_um(points[-memory(judged.modes, tick) :], judged.modes, tick, still_mm=1e-9)
    if not contour:
        return Figures(residual)
    _, _, moved = response(points, judged.modes, tick)
    over = (len(moved) - 1) // (len(points) - 1)
    return Figures(residual, contour_error_um(points, programmed), contour_error_um(moved[::over], programmed))


def memory(modes: list[list[Mode]], tick: float) -> int:
    """Ticks after which no mode remembers anything (1e-9)."""
    decays = [2.0 * np.pi * m.frequency_hz * m.damping_ratio for axis in modes for m in axis]
    return int(21.0 / min(decays) / tick) if decays and min(decays) > 0.0 else 10**9


def close(ours: float, theirs: float, relative: float = 0.1, absolute_um: float = 0.2) -> bool:
    """Whether two figures agree as well as two programs that share nothing should."""
    return abs(ours - theirs) <= max(absolute_um, relative * abs(theirs))


def check_figures(judged: Judged, *, contour_budget_s: float = 15.0) -> None:
    """The report's residuals, times and, within a budget of playing time, contour errors are the judge's too."""
    report = judged.conversion.to_dict()
    worst = {"command": 0.0, "response": 0.0}
    at_override = np.zeros((len(report["override_residual"]), 3))
    for programmed, blocks, entry in judged.regions():
        contour = entry["time_s"]["emitted"] <= contour_budget_s
        contour_budget_s -= entry["time_s"]["emitted"] if contour else 0.0
        runs = [figures(judged, blocks, programmed, rule, contour=contour) for rule in BLOCK_ENDS]
        residual = np.max([run.residual for run in runs], axis=0)
        for axis, ours in zip("xyz", residual, strict=True):
            theirs = entry["residual_vibration_um"]["emitted"][axis]
            assert close(ours, theirs), f"lines {entry['lines']}: residual {axis} {ours}, report {theirs}"
        if contour:
            reached = {what: max(getattr(run, what)[0] for run in runs) for what in worst}
            worst = {what: max(worst[what], reached[what]) for what in worst}
            ours, theirs = reached[report["limits"]["contour_target"]], entry["contour_error_um"]
            # The report measures along the path, in order; where a path comes near itself that is more.
            assert ours <= theirs + max(0.2, 0.02 * theirs), f"lines {entry['lines']}: contour {ours}, report {theirs}"
        for k, override in enumerate(report["override_residual"]):
            rule = judged.machine.controller.block_end
            run = figures(judged, blocks, programmed, rule, contour=False, override=override["override"])
            at_override[k] = np.maximum(at_override[k], run.residual)
        lasts = max(played_s(judged, blocks, rule) for rule in BLOCK_ENDS)
        assert abs(lasts - entry["time_s"]["emitted"]) < 2.1 * judged.machine.controller.interpolation_period_s
    for override, ours_xyz in zip(report["override_residual"], at_override, strict=True):
        for axis, ours in zip("xyz", ours_xyz, strict=True):
            assert close(ours, override["residual_um"][axis]), f"{override}: judge {ours_xyz}"
    for what, ours in worst.items():
        theirs = report["contour_error_um"][what]["emitted"]["max"]
        assert ours <= theirs + max(0.2, 0.02 * theirs), f"contour of the {what} {ours}, report {theirs}"


def played_s(judged: Judged, blocks: list[Move], rule: BlockEnd) -> float:
    """Time of a region's blocks and of the controller's own filter behind them."""
    tick = judged.machine.controller.interpolation_period_s
    cuts = [m for m in blocks if m.length > 0.0]
    ticks = max(0, round(judged.machine.controller.shaped_time_constant_s / tick) - 1)
    return float(durations(cuts, period_s=tick, block_end=rule).sum()) + ticks * tick if cuts else 0.0


def under_modes(
    conversion: sg.Conversion, program: sg.Program, tick_s: float, machines: Iterable[list[list[Mode]]]
) -> tuple[list[float], list[float]]:
    """Residual vibration and contour error, µm, of the only cut of a conversion under each of several sets of modes."""
    (place,) = conversion.placed
    first, last = place.original_lines
    emitted = interpret(conversion.text.decode()).lines[place.first_line - 1 : place.last_line]
    path = [move for line in interpret(program.text.decode()).lines[first - 1 : last] for move in line.moves]
    command = play([move for line in emitted for move in line.moves if move.length > 0.0], period_s=tick_s)
    residuals, contours = [], []
    for modes in machines:
        residuals.append(residual_um(command, modes, tick_s, still_mm=1e-9).max())
        contours.append(contour_error_um(response(command, modes, tick_s)[2][::10], path).max_um)
    return residuals, contours
