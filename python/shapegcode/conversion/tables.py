"""The tables of a conversion: original and emitted figures, and the sensitivity to unverified parameters."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from concurrent.futures import Executor, Future
from contextlib import suppress
from dataclasses import dataclass, replace
from itertools import islice
from pathlib import Path

from shapegcode import _core
from shapegcode.errors import MachineError
from shapegcode.machine import AxisMode, Machine
from shapegcode.model.machine_model import MachineModel
from shapegcode.model.modes import numbered_modes
from shapegcode.program import Program
from shapegcode.results.json import OldNames
from shapegcode.results.outcome import Pair, Xyz
from shapegcode.results.table import NO_BREAK, Column, Table
from shapegcode.settings.keys import KeyValue
from shapegcode.verdict.figures import Case, CaseFigures, Placed, case_figures, judge_region, unbroken
from shapegcode.verdict.judge import Judge, RegionFigures

_MIN_SHARE = 0.01  # of a limit: smaller effects do not matter
_FREE_S = 60.0  # total duration of motion that may always be simulated with contour error
_FULL_RUNS = 2  # simulations of a whole region; the verdict needs about twice as many
_FILTER_S = 0.024  # typical time constant (parameter 1769 or 1622) of a machining centre, if the file has none
_MODE = {"frequency_hz": 40.0, "damping_ratio": 0.02}  # typical of a machining centre, if no mode of an axis is known
_USUAL_MODE = f"a mode of {_MODE['frequency_hz']:g} Hz"
_PERCENT = {"frequency_hz": 5.0, "damping_ratio": 50.0, "participation": 30.0}  # default uncertainties


@dataclass(frozen=True)
class Sensitivity(OldNames):
    """An unverified value of the machine file, and its effect on the verdict."""

    key: str  # dotted name in the machine file
    value: str  # as in the file, with its unit
    origin: str  # "assumed", or "inherited" from another machine
    tested_value: str  # the changed value, as text
    figure: str  # the figure that increases most relative to its limit
    figure_um: float  # that figure with the value of the file
    tested_um: float  # that figure with the changed value
    limit_um: float  # its limit

    @property
    def share(self) -> float:
        """Change of the figure relative to its limit."""
        return (self.tested_um - self.figure_um) / self.limit_um if self.limit_um > 0.0 else 0.0


@dataclass(frozen=True)
class _Trial:
    value: KeyValue
    tested_value: str  # as text
    machine: Machine
    shift: float = 0.0
    only: str | None = None
    moves_command: bool = False  # the set-points change too, not only the machine table


StartedTrials = Mapping[tuple[str, str], "Future[CaseFigures]"]
"""Running simulations, by key and tested value."""


@dataclass(frozen=True)
class _Region:
    """A region that is simulated with changed values."""

    place: Placed
    emitted: Program
    judge: Judge
    tracker: _core.ContourTracker | None

    def simulate(self, trial: _Trial, *, contour: bool) -> CaseFigures:
        """Simulate with one value changed; without *contour* only the end of the region."""
        model, path = MachineModel(trial.machine), self.place.region.path
        contour = contour and self.needs_contour(trial)
        run = model.simulate_emitted(
            self.place.blocks(self.emitted), path, shift=trial.shift, only=trial.only,
            offset=model.offset(self.place.region), contour=contour,
            command_contour=self.judge.target == "command", response_contour=self.judge.target == "response",
            last_seconds=0.0 if contour else model.vibration_memory_s, tracker=self.tracker,
        )  # fmt: skip
        return case_figures(run, contour=contour, response=self.judge.target == "response")

    def needs_contour(self, trial: _Trial) -> bool:
        """True if the changed value affects the deviation that the contour tolerance limits."""
        return trial.moves_command or self.judge.target == "response"

    @property
    def moving(self) -> str:
        extent_mm = self.place.region.path.extent_mm
        return "".join(axis for axis, extent in zip("xyz", extent_mm, strict=True) if extent > 0.0)

    def sensitivity(self, value: KeyValue, tested: str, figures: RegionFigures, simulated: CaseFigures) -> Sensitivity:
        """Find the figure whose ratio to its limit a changed value raises most, compared with the nominal condition."""
        limits = self.judge.limits(figures, self.place)
        own = figures.emitted[self.judge.rules.index(self.judge.own_rule)]
        before = {each.figure: each for each in judge_region(case_figures(own), limits)}
        after = max(judge_region(simulated, limits), key=lambda each: each.share - before[each.figure].share)
        unit = f" {value.unit}" if value.unit not in ("", "1") and value.value not in ("not set", "[]") else ""
        shown = "none" if value.value == "[]" else value.value + unit
        origin = "assumed" if value.assumed else value.origin
        figure_um = before[after.figure].value_um
        return Sensitivity(value.key, shown, origin, tested, after.figure, figure_um, after.value_um, after.limit_um)


def start_trials(
    judge: Judge, machine: Machine, place: Placed, emitted: Program, tracker: _core.ContourTracker, pool: Executor
) -> StartedTrials:
    """For a single shaped cut: of the first trials of `parameter_sensitivity`, start those with the contour error."""
    region = _Region(place, emitted, judge, tracker)
    trials = filter(region.needs_contour, islice(_trials(machine, region.moving), _FULL_RUNS))
    return {_name(trial): pool.submit(region.simulate, trial, contour=True) for trial in trials}


def _name(trial: _Trial) -> tuple[str, str]:
    return trial.value.key, trial.tested_value


def parameter_sensitivity(
    judge: Judge,
    machine: Machine,
    simulated: Sequence[tuple[Placed, RegionFigures, _core.ContourTracker | None]],
    emitted: Program,
    deciding_lines: tuple[int, int],
    pool: Executor,
    started: StartedTrials,
    on_step: Callable[[int, int], None] = lambda _done, _total: None,
) -> tuple[tuple[Sensitivity, ...], int]:
    """The unverified values that matter for a program, largest effect on the verdict first; and the number tested."""
    regions = [(_Region(place, emitted, judge, tracker), figures) for place, figures, tracker in simulated]
    deciding, decided = next(pair for pair in regions if pair[0].place.original_lines == deciding_lines)
    moving = deciding.moving
    trials = [(deciding, decided, trial) for trial in _trials(machine, moving)]
    for axis, trial in _axis_trials(machine).items():
        if axis not in moving:
            pair = next((pair for pair in regions if axis in pair[0].moving), None)
            trials += [(*pair, trial)] if pair is not None else []
    left_s = max(_FREE_S, _FULL_RUNS * sum(figures.emitted_s for _, figures in regions))
    running = []
    for region, figures, trial in trials:
        left_s -= figures.emitted_s
        run = started.get(_name(trial))
        running.append(pool.submit(region.simulate, trial, contour=left_s >= 0.0) if run is None else run)
    rows = []
    for done, ((region, figures, trial), run) in enumerate(zip(trials, running, strict=True), start=1):
        rows.append(region.sensitivity(trial.value, trial.tested_value, figures, run.result()))
        on_step(done, len(trials))
    rows += _from_cases(machine, deciding, decided)
    return _ranked(rows), len({row.key for row in rows})


def _ranked(rows: Sequence[Sensitivity]) -> tuple[Sensitivity, ...]:
    """The worst trial of each key, largest effect first, at most 8; no small effects, unless of unknown modes."""
    worst: dict[str, Sensitivity] = {}
    for row in rows:
        matters = row.share >= _MIN_SHARE or row.key.endswith(".modes")
        if matters and (row.key not in worst or row.share > worst[row.key].share):
            worst[row.key] = row
    return tuple(sorted(worst.values(), key=lambda row: -row.share)[:8])


def _trials(machine: Machine, moving: str) -> Iterator[_Trial]:
    unmeasured = {value.key: value for value in machine.values() if value.unmeasured}
    now_s = machine.controller.shaped_time_constant_s
    other_s = 1.2 * now_s if now_s else _FILTER_S
    yield from _other_command(machine, unmeasured, "controller.shaped_time_constant_s", other_s)
    yield from (trial for axis, trial in _axis_trials(machine).items() if axis in moving)
    yield from _frequencies(machine, unmeasured, moving)
    yield from _shares(machine, unmeasured, moving)
    freed = machine.with_values("emission.block_period_s", None)
    period_s = 2.0 * machine.controller.interpolation_period_s
    yield from _other_command(freed, unmeasured, "controller.interpolation_period_s", period_s)


def _other_command(machine: Machine, unmeasured: Mapping[str, KeyValue], key: str, other_s: float) -> Iterator[_Trial]:
    """A trial of another time constant or period, with other set-points; none if it was measured or is invalid."""
    with suppress(MachineError):
        if key in unmeasured:
            yield _Trial(unmeasured[key], f"{other_s:g} s", machine.with_values(key, other_s), moves_command=True)


def unknown_axes(machine: Machine) -> dict[str, KeyValue]:
    """Axes of which it is unknown whether they have a mode, with their keys."""
    values = {value.key: value for value in machine.values()}
    return {
        letter: replace(values[f"axes.{letter}.modes"], origin="assumed", assumed=True)
        for letter, axis in zip("xyz", machine.axes.as_tuple(), strict=True)
        if not axis.modes and (not axis.rigid or values[f"axes.{letter}.rigid"].unmeasured)
    }


def _with_usual_modes(machine: Machine, letters: Iterable[str]) -> Machine:
    values: dict[str, object] = {}
    for letter in letters:
        values |= {f"axes.{letter}.rigid": False, f"axes.{letter}.modes": [_MODE]}
    return machine.with_values(values) if values else machine


def _axis_trials(machine: Machine) -> dict[str, _Trial]:
    unknown = unknown_axes(machine)
    return {axis: _Trial(value, _USUAL_MODE, _with_usual_modes(machine, axis)) for axis, value in unknown.items()}


def rank_unknown_axes(program: Program | str | Path, machine: Machine) -> tuple[Sensitivity, ...]:
    """Rank axes with unknown modes by how much a typical mode there would vibrate: measure the first one first."""
    from shapegcode.simulation.simulate import simulate

    unknown = unknown_axes(machine)
    simulated = simulate(program, _with_usual_modes(machine, unknown), record_samples=0)
    rows = [
        Sensitivity(
            value.key, "none", "assumed", _USUAL_MODE, f"residual vibration {letter.upper()}", 0.0,
            simulated.residual_vibration_um[letter], machine.tolerance.residual_floor_um,
        )
        for letter, value in unknown.items()
    ]  # fmt: skip
    return tuple(sorted(rows, key=lambda row: -row.tested_um))


def _modes(
    machine: Machine, unmeasured: Mapping[str, KeyValue], moving: str, name: str
) -> Iterator[tuple[str, AxisMode]]:
    """Yield key and mode of every mode that a moving axis excites and whose value `name` is unverified."""
    for stem, axis, mode in numbered_modes(machine):
        excited = any(share and by in moving for share, by in zip(mode.excitation(axis), "xyz", strict=True))
        if excited and f"{stem}.{name}" in unmeasured:
            yield stem, mode


def _frequencies(machine: Machine, unmeasured: Mapping[str, KeyValue], moving: str) -> Iterator[_Trial]:
    """Trials of frequencies, up and down; a table over position or mass is scaled as a whole."""
    for stem, mode in _modes(machine, unmeasured, moving, "frequency_hz"):
        stated = mode.frequency_uncertainty_percent
        percent = stated if stated is not None else _PERCENT["frequency_hz"]
        sharp = {f"{stem}.frequency_uncertainty_percent": percent, f"{stem}.damping_uncertainty_percent": None}
        other = machine.with_values(sharp)
        only = stem.removeprefix("axes.").replace(".modes", "")
        for shift in (-1.0, 1.0):
            yield _Trial(unmeasured[f"{stem}.frequency_hz"], f"{shift * percent:+g} %", other, shift, only)


def _shares(machine: Machine, unmeasured: Mapping[str, KeyValue], moving: str) -> Iterator[_Trial]:
    """Trials with more residual vibration: less damping, more participation."""
    for name, sign in (("damping_ratio", -1.0), ("participation", 1.0)):
        for stem, mode in _modes(machine, unmeasured, moving, name):
            stated = mode.damping_uncertainty_percent if name == "damping_ratio" else None
            percent = sign * (stated if stated is not None else _PERCENT[name])
            with suppress(MachineError):
                other = machine.with_values(f"{stem}.{name}", getattr(mode, name) * (1.0 + percent / 100.0))
                yield _Trial(unmeasured[f"{stem}.{name}"], f"{percent:+g} %", other)


def _from_cases(machine: Machine, region: _Region, figures: RegionFigures) -> Iterator[Sensitivity]:
    """Yield results of operating conditions that do not count: other block timing, look-ahead on, underrun."""
    unmeasured = {value.key: value for value in machine.values() if value.unmeasured}
    for case, simulated in zip(region.judge.cases, figures.cases, strict=True):
        key, tested = _key_of(case)
        if not case.counts and key in unmeasured and simulated is not None:
            yield region.sensitivity(unmeasured[key], tested, figures, simulated)


def _key_of(case: Case) -> tuple[str, str]:
    """The key that an operating condition varies, and the tested value; empty if it varies none."""
    if case.look_ahead:
        return "controller.motion", case.name
    if case.starved_s > 0.0:
        return "controller.block_time_s", f"longer: buffer {case.name}"
    return ("controller.block_end", case.name) if case.nominal else ("", "")


def change_percent(original: float, emitted: float) -> str:
    """Change from original to emitted in percent, as text; the original is not zero."""
    change = (emitted - original) / abs(original) * 100
    return "0 %" if abs(change) < 0.05 else f"{change:+.1f} %"


@dataclass(frozen=True)
class BeforeAfter:
    """One line of the table: a figure of both programs, or of the emitted one only."""

    figure: str  # its name
    unit: str  # its unit
    original: float | None  # figure of the original program; None if there is none
    emitted: float  # figure of the emitted program
    digits: int = 1  # decimals
    limit: float | None = None  # limit of the emitted figure; None if not judged

    @property
    def change(self) -> str:
        """Change from original to emitted; empty if the original is missing or too small."""
        # Percentages of smaller values would compare round-off errors.
        least = 1.0 if self.unit == "µm" else 0.5 * 10.0**-self.digits
        if self.original is None or abs(self.original) < least:
            return ""
        return change_percent(self.original, self.emitted)

    def text(self, value: float | None) -> str:
        """Format one of its figures."""
        return "" if value is None else f"{float(value):z.{self.digits}f}"


def before_after_table(groups: Sequence[Sequence[BeforeAfter]]) -> Table:
    """Figures of original and emitted program, in groups."""
    columns = (
        Column("figure", text=True),
        Column("unit", text=True),
        Column("original", value=lambda row: row.text(row.original)),
        Column("emitted", value=lambda row: row.text(row.emitted)),
        Column("change"),
        Column("limit", value=lambda row: row.text(row.limit)),
    )
    filled = [group for group in groups if group]
    sections = [sum(len(group) for group in filled[:rank]) for rank in range(1, len(filled))]
    return Table("", columns, [row for group in filled for row in group], sections=sections)


def sensitivity_table(rows: Sequence[Sensitivity], tried: int) -> Table:
    """The sensitivity to unverified parameters as a table."""
    columns = (
        Column("key", left=True),
        Column(
            "value → tested", value=lambda row: unbroken(f"{row.value} {row.origin} → {row.tested_value}"), text=True
        ),
        Column("figure, µm", value=_figure, text=True),
        Column("limit", value="limit_um", digits=1),
    )
    return Table(
        "sensitivity to unverified parameters (assumed or inherited), one at a time",
        columns,
        rows,
        caption=f"{tried} tested in the cut closest to a limit; small effects left out",
        row_style=lambda row: "red" if row.tested_um > row.limit_um else "",
    )


def _figure(row: Sensitivity) -> str:
    name = row.figure.replace("residual vibration", "residual").replace("contour error", "contour")
    return f"{name.partition(' of ')[0]} " + f"{row.figure_um:.1f} → {row.tested_um:.1f}".replace(" ", NO_BREAK)


Lines = tuple[int, int]

_SHOWN = 12
_TOOL_CHANGE = 6


@dataclass(frozen=True)
class CutOutcome(OldNames):
    """One cut, shaped or left unchanged."""

    lines: Lines  # first and last line of the original
    emitted_lines: Lines  # likewise of the emitted program
    tool: int | None  # T number that cuts; null: none programmed before
    is_shaped: bool  # False: it was left unchanged
    reason: str  # why it was left unchanged; empty if shaped
    # gain of shaping: the larger reduction of residual vibration and contour error of the machine table; for a cut that
    # was never simulated as shaped, its upper bound
    gain_um: float
    residual_um: Pair[float]  # residual vibration of the worst axis
    contour_um: Pair[float]  # contour error of the target of the tolerance
    tolerance_um: float  # contour tolerance for which it was shaped; above the machine's if the price requires it
    time_s: Pair[float]  # until the set-points rest
    bytes: Pair[int]  # size of its text
    misses: tuple[str, ...]  # limits that it misses, as text
    # remedy for limits missed by a cut left unchanged; empty: none missed, or the cut is shaped
    remedy: str = ""


def remedy_for(reason: str) -> str:
    """Remedy for the reason of a cut left unchanged."""
    if "price." in reason:
        return "allow more time (--max-cut-time-increase, --max-time-increase) or a larger --contour-tolerance"
    if "--only" in reason or "--leave" in reason:
        return "select it too"
    if "minimum_feed" in reason or "feed" in reason.partition(" ")[0]:
        return "a programmed feed of controller.minimum_feed_mm_per_min or more"
    if "max_program" in reason or "bytes" in reason or "baud" in reason:
        return "a larger size or rate limit for the program: the limits are in the reason"
    return "a lower programmed feed there, or --shape-all to see the effect of shaping"


def cut_table(cuts: Sequence[CutOutcome], *, every: bool) -> Table:
    """Table of cuts in program order: all, or those that miss a limit or gain most."""
    ranked = sorted(cuts, key=lambda cut: (not cut.misses, -cut.gain_um))
    shown = list(cuts) if every else sorted(ranked[:_SHOWN], key=lambda cut: cut.lines)
    columns = (
        Column("lines", value=lambda cut: "{}-{}".format(*cut.lines), left=True),
        Column("tool", value=lambda cut: "" if cut.tool is None else f"T{cut.tool}"),
        Column("gain µm", value="gain_um", digits=1),
        Column("residual µm", value=lambda cut: _change(cut.residual_um)),
        Column("contour µm", value=lambda cut: _change(cut.contour_um)),
        Column("time s", value=lambda cut: _change(cut.time_s, 2), priority=2),
        Column("bytes", value=lambda cut: _change(cut.bytes, 0), priority=3),
        Column("shaped, or why not", value=lambda cut: "shaped" if cut.is_shaped else cut.reason, text=True),
    )
    left = f"; {len(cuts) - len(shown)} more in --verbose, --html and --json" if len(shown) < len(cuts) else ""
    shaped = sum(cut.is_shaped for cut in cuts)
    return Table(
        "cut by cut: original → emitted",
        columns,
        shown,
        caption=f"{shaped} of {len(cuts)} cuts shaped{left}",
        row_style=lambda cut: "red" if cut.misses else "" if cut.is_shaped else "dim",
    )


def _change(pair: Pair[float] | Pair[int], digits: int = 1) -> str:
    before, after = (f"{each:z.{digits}f}" for each in (pair.original, pair.emitted))
    return before if before == after else f"{before} → {after}"


def chosen_cuts(program: Program, only: Sequence[Lines] | None, leave: Sequence[Lines]) -> dict[int, str]:
    """Cuts that are not shaped because of --only or --leave, with the reason."""
    last = program.core.line_count
    spans = [(region.first_line, region.last_line) for region in program.regions]
    for option, ranges in (("--only", only or ()), ("--leave", leave)):
        if any(not isinstance(each, tuple | list) or len(each) != 2 for each in ranges):
            raise _core.ArgumentError(f"{option[2:]}: pairs of lines are needed, such as [(10, 20), (35, 40)]")
        for begin, end in ranges:
            if not 1 <= begin <= end <= last:
                raise _core.ArgumentError(f"{option} {begin}-{end}: {program.source} has lines 1 to {last}")
            if not any(first <= end and begin <= to for first, to in spans):
                near = ", ".join("{}-{}".format(*span) for span in spans[:4]) + (" ..." if len(spans) > 4 else "")
                raise _core.ArgumentError(
                    f"{option} {begin}-{end}: no cut that can be shaped there; cuts are in lines {near or 'none'}"
                )
    found = {}
    for index, (first, to) in enumerate(spans):
        is_left = any(first <= end and begin <= to for begin, end in leave)
        is_chosen = any(first <= end and begin <= to for begin, end in only or ())
        if is_left and is_chosen:
            raise _core.ArgumentError(
                f"--only and --leave both contain the cut in lines {first} to {to}: list it in one of them"
            )
        if is_left:
            found[index] = "listed in --leave"
        elif only is not None and not is_chosen:
            found[index] = "not listed in --only"
    return found


def tools_of_cuts(program: Program) -> Mapping[int, int]:
    """T number in the spindle by index of the cut."""
    functions = program.core.functions
    changes = any(_TOOL_CHANGE in codes for codes, _, _ in functions)  # else T alone changes the tool
    found: dict[int, int] = {}
    ready = current = -1
    for kind, index, _ in program.core.steps:
        if kind == _core.StepKind.function:
            codes, tool, _ = functions[index]
            ready = tool if tool >= 0 else ready
            if _TOOL_CHANGE in codes or not changes:
                current = ready
        elif kind == _core.StepKind.region and current >= 0:
            found[index] = current
    return found


@dataclass(frozen=True)
class RapidMove:
    """A rapid that was replaced by a shaped cutting move."""

    lines: tuple[int, int]  # first and last line of the original
    emitted_lines: tuple[int, int]  # likewise of the emitted program
    time_s: Pair[float]  # until the set-points rest
    in_position_s: Pair[float]  # wait for in-position after them
    settling_s: Pair[float]  # from the end of the set-points until the table stays within the band
    residual_vibration_um: Pair[Xyz[float]]  # largest |table - command| while the set-points rest
    residual_limit_um: Xyz[float]  # limit of the emitted one
    misses: tuple[str, ...]  # missed tolerances; always empty: a rapid that would miss one is left unchanged


@dataclass(frozen=True)
class RapidsOutcome(OldNames):
    """The rapids of a program: number shaped, reasons of the others, and time saved."""

    found: int  # rapids in the program
    shaped: int  # number replaced by shaped moves
    left_unchanged: Mapping[str, int]  # number left unchanged, by reason
    time_saved_s: float  # total time by which the next cuts can start sooner
    settle_band_um: float  # half the width of the band in which vibration counts as having decayed
    blocks: int  # shaped blocks that replace them
    slowed_blocks: int  # of these, blocks that look-ahead would slow: speed step or feed of an axis above its limit
    moves: tuple[RapidMove, ...]  # the replaced ones
