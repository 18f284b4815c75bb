"""Learns the clock of a machine from programs and the logs of their runs."""

from __future__ import annotations

import math
from collections import defaultdict
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from shapegcode.characterization.clock.families import FAMILIES, LookAhead, fitted_model
from shapegcode.characterization.clock.file_values import feeds_of, learned_machine, usual_value
from shapegcode.characterization.clock.function_fit import FunctionFit, fit_functions, whole_model
from shapegcode.characterization.clock.motion_fit import MotionFit, fit_motion
from shapegcode.characterization.clock.observed import ObservedRun, observe
from shapegcode.characterization.clock.played import PlayedProgram, played_program
from shapegcode.characterization.clock.predict import holds_of, predicted_starts, shares_of
from shapegcode.characterization.clock.result import TOLERANCE_PERCENT, FamilyScore, LearnedClock, LearnedRun
from shapegcode.characterization.clock.shown import rapid_rate, seen_arc_acceleration, with_override
from shapegcode.characterization.clock.windows import clocks_of, misfit, section_residuals
from shapegcode.characterization.runs_file import RunsFile, load_runs
from shapegcode.errors import ArgumentError
from shapegcode.machine import Machine
from shapegcode.program import Program

__all__ = ["learn_clock"]

_MOST_FOLDS = 4
_BETTER = 0.97  # a family further down the list must be better by so much to be taken
_LEAST_SPREAD = 0.005  # of what a machine takes for its cuts: no model is truer
_MOST_HOLDS = 6  # of one run that may be true
_CALLS = 2500  # of the misfit that one fit takes, about; for the bar


@dataclass(frozen=True, eq=False)
class _Learned:
    """Motion and functions, from some of the runs."""

    motion: MotionFit
    functions: FunctionFit
    machine: Machine

    def starts(self, run: ObservedRun) -> np.ndarray:
        values = self.functions.values
        model = whole_model(self.machine, self.motion, values, self.functions.last_tool_in_spindle)
        return predicted_starts(run, model)


def learn_clock(
    runs: RunsFile | str | Path,
    machine: Machine,
    *,
    families: Sequence[str] | None = None,
    on_progress: Callable[[float], None] | None = None,
) -> LearnedClock:
    """Learn what the clock of a machine depends on from what it did.

    Logs are laid beside their programs by line; overrides and holds are found. Several kinds of look-ahead are fitted
    to what stretches between functions took, and the one is taken that says best what programs (or runs, where there
    is one program) took that it was not fitted to. Tool changes, M codes, spindle and unknown ways follow by least
    squares.

    Args:
        runs: pairs of program and log, or the file that lists them (RUNS.toml).
        machine: whose file gets the numbers, and that says how programs are read.
        families: names of the kinds of look-ahead that are tried; None: all.
        on_progress: told the share of the work done, 0 to 1.

    Returns:
        The numbers with 95 % intervals, the machine with them, and each run beside what was predicted.

    Raises:
        ArgumentError: no run is to be fitted, or a family that does not exist.
        RecordError: a log and its program do not belong together, or a log cannot be used; with the line.
        ProgramError, RunsFileError: bad input.
        OSError: a file cannot be read.
    """
    file = runs if isinstance(runs, RunsFile) else load_runs(runs)
    tried = _families(families)
    observed = _observed(file, machine)
    # The rate of the machine is what the runs show that are learned from; of the others it tells the override.
    fitted, others_seen = ([run for run in observed if run.entry.use == use] for use in ("fit", "test"))
    rate, fitted = rapid_rate(fitted)
    observed = [*fitted, *(with_override(run, rate) for run in others_seen)]
    if not fitted:
        raise ArgumentError(f'{file.path}: no run has use = "fit": there is nothing to learn from')
    folds = _folds(fitted)
    meter = _Meter(on_progress, len(tried) * (1 + (len(folds) if len(folds) > 1 else 0)))
    fits, scores = _tried(tried, fitted, folds, machine, rate, meter)
    order = [score.left_out_s if score.left_out_s is not None else score.fitted_s for score in scores]
    best = 0
    for index in range(1, len(order)):
        if order[index] < _BETTER * order[best]:
            best = index
    motion = fits[best]
    learned = _Learned(motion, fit_functions(fitted, motion, machine), machine)
    others = _left_out(fitted, folds, motion, machine, rate) if len(folds) > 1 else {}
    rows, warnings = _rows(observed, learned, others)
    with_it, remarks, numbers, not_told = learned_machine(machine, motion, learned.functions, fitted)
    return LearnedClock(
        machine=machine.name,
        family=motion.family.name,
        families=tuple(scores),
        numbers=tuple(numbers),
        runs=tuple(rows),
        fitted=with_it,
        remarks=remarks,
        not_told=tuple(not_told),
        warnings=tuple(dict.fromkeys(warnings)),
    )


class _Meter:
    """How far the work is: by fits begun, and by steps within one."""

    def __init__(self, on_progress: Callable[[float], None] | None, fits: int) -> None:
        self._on_progress, self._fits, self._done, self._steps = on_progress, fits, 0, 0

    def step(self) -> None:
        self._steps += 20
        if self._on_progress is not None:
            within = min(0.99, self._steps / _CALLS)
            self._on_progress(0.97 * (self._done + within) / self._fits)

    def next(self) -> None:
        self._done, self._steps = min(self._done + 1, self._fits - 1), 0


def _families(names: Sequence[str] | None) -> list[LookAhead]:
    if names is None:
        return list(FAMILIES)
    known = {family.name: family for family in FAMILIES}
    unknown = [name for name in names if name not in known]
    if unknown or not names:
        raise ArgumentError(f"kind of look-ahead {unknown[0] if unknown else ''!r}: must be one of {', '.join(known)}")
    return [known[name] for name in names]


def _observed(file: RunsFile, machine: Machine) -> list[ObservedRun]:
    played: dict[Path, PlayedProgram] = {}
    found = []
    for entry in file.used:
        path = entry.program.resolve()
        if path not in played:
            played[path] = played_program(Program.read(entry.program, machine))
        found += [observe(entry, log, played[path], machine) for log in entry.read()]
    return found


def _folds(runs: Sequence[ObservedRun]) -> list[list[ObservedRun]]:
    """Runs that are left out together: those of a program; with one program, which tells less, every other run."""
    by_program: dict[int, list[ObservedRun]] = defaultdict(list)
    for run in runs:
        by_program[id(run.played)].append(run)
    groups = list(by_program.values()) if len(by_program) > 1 else [[run] for run in runs]
    count = min(_MOST_FOLDS if len(by_program) > 1 else 2, len(groups))
    folds: list[list[ObservedRun]] = [[] for _ in range(count)]
    for index, group in enumerate(groups):
        folds[index % len(folds)] += group
    return folds


def _seen(runs: Sequence[ObservedRun]) -> dict[str, float]:
    across = seen_arc_acceleration(runs)
    return {"arc_acceleration": across} if math.isfinite(across) else {}


def _tried(
    tried: Sequence[LookAhead],
    runs: Sequence[ObservedRun],
    folds: Sequence[Sequence[ObservedRun]],
    machine: Machine,
    rate: float,
    meter: _Meter,
) -> tuple[list[MotionFit], list[FamilyScore]]:
    clocks = clocks_of(runs)
    if not clocks:
        raise ArgumentError(
            "no log reports lines of a stretch of cuts often enough (10 readings): there is nothing to learn from"
        )
    fits, scores = [], []
    for family in tried:
        fit = fit_motion(clocks, family, machine, rate, seen=_seen(runs), on_step=meter.step)
        meter.next()
        left_out = []
        for fold in folds if len(folds) > 1 else ():
            rest = [run for run in runs if run not in fold]
            part = fit_motion(
                clocks_of(rest), family, machine, rate, seen=_seen(rest), on_step=meter.step, thorough=False
            )
            left_out.append(misfit(clocks_of(fold), fitted_model(machine, family, part.values, rate)))
            meter.next()
        fits.append(fit)
        score = misfit(clocks, fitted_model(machine, family, fit.values, rate))
        scores.append(FamilyScore(family.name, family.meaning, score, float(np.mean(left_out)) if left_out else None))
    return fits, scores


def _left_out(
    runs: Sequence[ObservedRun],
    folds: Sequence[Sequence[ObservedRun]],
    motion: MotionFit,
    machine: Machine,
    rate: float,
) -> dict[int, _Learned]:
    """For each run what the others teach."""
    found = {}
    for fold in folds:
        rest = [run for run in runs if run not in fold]
        part = fit_motion(clocks_of(rest), motion.family, machine, rate, seen=_seen(rest))
        other = _Learned(part, fit_functions(rest, part, machine), machine)
        found.update({id(run): other for run in fold})
    return found


def _rows(
    observed: Sequence[ObservedRun], learned: _Learned, others: dict[int, _Learned]
) -> tuple[list[LearnedRun], list[str]]:
    spread = _spread(observed, learned, others)
    rows = [_row(run, learned, others.get(id(run)), spread) for run in observed]
    # What whole runs left out were off by is in the interval, too: a start that an operator delays, a tool at hand.
    off = [row.left_out_percent / 100.0 for row in rows if row.left_out_percent is not None]
    whole = 2.0 * math.sqrt(sum(each**2 for each in off) / len(off)) if off else 0.0
    rows = [_widened(row, whole) for row in rows]
    warnings = []
    for row in rows:
        judged = row.judged_percent
        if judged is not None and abs(judged) > TOLERANCE_PERCENT:
            warnings.append(f"{row.name}: {judged:+.1f} % from what it took, more than {TOLERANCE_PERCENT:g} %")
        if len(row.holds) > _MOST_HOLDS:
            warnings.append(
                f"{row.name}: stood {len(row.holds)} times where the program does not ask for it, first at "
                f"{row.holds[0]}: the program may have been changed after the run"
            )
        else:
            warnings += [f"{row.name}: held at {hold}" for hold in row.holds]
    return rows, warnings


def _row(run: ObservedRun, learned: _Learned, other: _Learned | None, spread: float) -> LearnedRun:
    starts = learned.starts(run)
    holds = holds_of(run, starts)
    tools, kinds = shares_of(run, starts, holds)
    reach = _reach(run, starts, spread, learned.functions)
    return LearnedRun(
        program=str(run.entry.program),
        log=run.log.source,
        use=run.entry.use,
        measured_s=run.duration_s,
        held_s=sum(length for _, length, _ in holds),
        predicted_s=float(starts[-1]),
        low_s=float(starts[-1]) - reach,
        high_s=float(starts[-1]) + reach,
        left_out_s=float(other.starts(run)[-1]) if other is not None else None,
        feed_override=usual_value([run], feeds_of),
        rapid_override=run.rapid_override,
        tools=tools,
        kinds=kinds,
        holds=tuple(f"{begin:.1f} s: {length:.1f} s, {why}" for begin, length, why in holds),
        notes=run.notes,
    )


def _widened(row: LearnedRun, ratio: float) -> LearnedRun:
    low, high = row.predicted_s * (1.0 - ratio), row.predicted_s * (1.0 + ratio)
    return replace(row, low_s=min(row.low_s, low), high_s=max(row.high_s, high))


def _spread(observed: Sequence[ObservedRun], learned: _Learned, others: dict[int, _Learned]) -> float:
    """Root mean square of the relative error of whole sections, of runs left out where there are any."""
    square = weight = 0.0
    for run in observed:
        if run.entry.use != "fit":
            continue
        who = others.get(id(run), learned)
        model = fitted_model(who.machine, who.motion.family, who.motion.values, who.motion.rapid_mm_per_s)
        clocks = clocks_of([run])
        holds = holds_of(run, who.starts(run))
        for clock, residual in zip(clocks, section_residuals(clocks, model), strict=True):
            begin, end = float(clock.time_s[0]), float(clock.time_s[-1])
            if any(since < end and since + length > begin for since, length, _ in holds):
                continue
            took = end - begin
            error = float(np.median(residual[-4:]) - np.median(residual[:4]))
            square += min(error / took, 0.2) ** 2 * took if took > 0.0 else 0.0
            weight += took
    return max(math.sqrt(square / weight) if weight > 0.0 else 0.0, _LEAST_SPREAD)


def _reach(run: ObservedRun, starts: np.ndarray, spread: float, functions: FunctionFit) -> float:
    """Half of the 95 % interval of a run's time: cuts err together, what lies between them by itself."""
    cut = sum(float(starts[stretch.lines[1] + 1] - starts[stretch.lines[0]]) for stretch in run.stretches)
    between = len(run.stretches)
    return 2.0 * math.sqrt((spread * cut) ** 2 + between * functions.scatter_s**2)
