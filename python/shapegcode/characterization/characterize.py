"""Fits controller parameters to the results of the tests, and returns the machine with them."""

from collections import defaultdict
from collections.abc import Callable, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

from shapegcode.characterization.log_fit import fit_logs
from shapegcode.characterization.programs import SHEET, FilledSheet, read_sheet
from shapegcode.characterization.result import CUTTING_SUM, Characterisation, ControllerFact, combine, mean
from shapegcode.characterization.stopwatch import fit_stopwatch
from shapegcode.errors import ArgumentError
from shapegcode.io.servo_log import parse_units, read_log
from shapegcode.machine import Machine

_CUTTING = ("cutting acceleration shape", "cutting time constant", "cutting bell time", CUTTING_SUM)
_OF_AXES = ("in-position time", "rapid time constant", "rapid bell time", "position gain", "feed-forward")
_ORDER = (
    *("interpolation period", "block end", "block time", *_CUTTING),
    *(f"{what} {axis}" for what in _OF_AXES for axis in "XYZ"),
)
_SHAPES = {"bell": "linear", "linear or bell": "linear"}  # in the machine file
_SAME = "straight moves between stops are the same with and without look-ahead: a setting, not a finding"
_NOT_SEEN = ControllerFact("motion", None, None, None, "", "", "", _SAME)


def characterize(
    results: str | Path,
    machine: Machine,
    *,
    units: str | None = None,
    on_progress: Callable[[float], None] = lambda _done: None,
) -> Characterisation:
    """Fit controller parameters to results of the programs of `write_characterization_tests`.

    Args:
        results: a filled-in RESULTS.toml, the folder with it and the logs, or one log in that folder.
        machine: machine that gets the values.
        units: of time and length in the logs, for example "ms,um"; None: from their headers.
        on_progress: called with the completed fraction, 0 to 1.

    Returns:
        Parameters with 95 % intervals, unknown ones with the reason, and the machine with the known ones.

    Raises:
        ArgumentError, FileError: bad input, with file, line, value and limit.
        MachineError: the values contradict others of the machine file; the message names both.
        OSError: a file cannot be read.
    """
    sheet = _sheet(Path(results))
    if not sheet.times_s and not sheet.logs:
        raise ArgumentError(
            f"{sheet.file}: nothing was measured: no times_s, no log (a log next to the file is found by the name of "
            "its test, such as log_cutting.csv)"
        )
    factors, logs = parse_units(units) if units is not None else None, {}
    for done, (name, path) in enumerate(sheet.logs.items(), start=1):
        logs[name] = read_log(path, factors)
        on_progress(0.5 * done / len(sheet.logs))
    found = fit_logs(sheet.tests, logs) if logs else []
    contradictions: list[str] = []
    if sheet.times_s:
        watch = fit_stopwatch(sheet)
        found, contradictions = combine(found, watch.found), watch.contradictions
    rank = {name: index for index, name in enumerate(_ORDER)}
    facts = sorted([*found, _NOT_SEEN], key=lambda each: rank.get(each.quantity, len(rank)))
    fitted, remarks = _fitted(machine, facts)
    return Characterisation(
        machine=machine.name,
        findings=tuple(replace(each, assumed=_assumed(machine, each.key)) for each in facts),
        files=(sheet.file, *(str(path) for path in sheet.logs.values())),
        fitted=fitted,
        remarks=remarks,
        warnings=tuple(contradictions),
    )


def _sheet(source: Path) -> FilledSheet:
    """Read results, given RESULTS.toml, its folder, or a log in that folder."""
    if source.is_dir():
        return read_sheet(source / SHEET)
    if source.suffix.lower() == ".toml":
        return read_sheet(source)
    beside = source.parent / SHEET
    if not beside.is_file():
        raise ArgumentError(f"{source}: no {SHEET} in the same folder, which describes the program")
    sheet = read_sheet(beside)
    name = next((name for name, log in sheet.logs.items() if log.resolve() == source.resolve()), source.stem)
    if name not in sheet.tests:
        logs = ", ".join(sorted(each for each, test in sheet.tests.items() if test.kind == "log"))
        raise ArgumentError(f"{source}: {beside} has no test {source.stem}; name the log after its test: {logs}")
    return replace(sheet, times_s={}, logs={name: source})


def _assumed(machine: Machine, key: str) -> float | str | None:
    """Value of a key in the machine file; None if not set."""
    held: Any = machine
    for name in key.split("."):
        inner = getattr(held, name, None)
        if inner is None:  # one value for all axes
            break
        held = inner
    return held if isinstance(held, int | float | str) else None


def _fitted(machine: Machine, facts: Sequence[ControllerFact]) -> tuple[Machine, dict[str, str]]:
    """The machine with all known parameters, and a remark for each key that was set."""
    values: dict[str, object] = {}
    remarks: dict[str, str] = {}
    for_all: dict[str, list[ControllerFact]] = defaultdict(list)
    split = any(each.quantity == "cutting time constant" and each.value is not None for each in facts)
    for fact in facts:
        if fact.value is None or not fact.key or (fact.quantity == CUTTING_SUM and split):
            continue
        head, _, last = fact.key.rpartition(".")
        of_axis = last in ("x", "y", "z")
        if of_axis and _assumed(machine, head) is not None:
            for_all[head].append(fact)
            continue
        value = fact.value
        values[fact.key] = round(value, 7) if isinstance(value, float) else _SHAPES.get(value, value)
        if fact.quantity == CUTTING_SUM and isinstance(value, float):
            # Only the sum of both times is known: the file's bell time stays if it is below the sum.
            bell = machine.controller.bell_time_s if machine.controller.bell_time_s < value else 0.0
            values |= {"controller.bell_time_s": bell, fact.key: round(value - bell, 7)}
        key, text = (head, f"{last} ") if of_axis else (fact.key, "")
        text += f"{fact.low:.6g} ... {fact.high:.6g}" if fact.low is not None else "fitted"
        remarks[key] = f"{remarks[key]}, {text}" if key in remarks else f"measured ({fact.source}): {text}"
    for key, several in for_all.items():
        # One value for all axes in the file: their mean.
        halves = [((each.high or 0.0) - (each.low or 0.0)) / 2.0 + 1e-6 for each in several]
        centre, half = mean([float(each.value or 0.0) for each in several], halves)
        values[key] = round(centre, 7)
        remarks[key] = f"measured ({several[0].source}), mean of the axes: ± {half:.2g}"
    fitted = machine.with_values(values, source="the machine with the fitted values")
    return fitted.with_remarks(machine.all_remarks() | remarks), remarks
