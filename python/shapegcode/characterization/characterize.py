"""From the results of the tests to facts of the controller, and from them to a machine file."""

from __future__ import annotations

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

_ORDER = (
    "interpolation period",
    "block end",
    "block time",
    "cutting acceleration shape",
    "cutting time constant",
    "cutting bell time",
    CUTTING_SUM,
    *(
        f"{what} {axis}"
        for what in ("in-position time", "rapid time constant", "rapid bell time", "position gain", "feed-forward")
        for axis in "XYZ"
    ),
)
_SHAPES = {"linear": "linear", "bell": "linear", "linear or bell": "linear", "exponential": "exponential"}
_NOT_SEEN = ControllerFact(
    "motion",
    None,
    None,
    None,
    "",
    "",
    "",
    "straight moves between stops look the same with and without look-ahead: a setting, not a finding",
)


def characterize(
    results: str | Path,
    machine: Machine,
    *,
    units: str | None = None,
    on_progress: Callable[[float], None] | None = None,
) -> Characterisation:
    """Fit a controller to what was measured with the programs of `write_characterization_tests`.

    Args:
        results: a filled-in RESULTS.toml, the folder that holds it and the logs, or one log beside it.
        machine: whose file gets the values.
        units: of time and length in the logs, for example "ms,um"; None: from their headers.
        on_progress: told the share of the work done, 0 to 1.

    Returns:
        What is known, with 95 % intervals, and the machine with it.

    Raises:
        ArgumentError, FileError: bad input, with file, line, value and limit.
        MachineError: the values do not go with others of the machine file; the message names both.
        OSError: a file cannot be read.
    """
    sheet = _sheet(Path(results))
    if not sheet.times_s and not sheet.logs:
        raise ArgumentError(
            f"{sheet.file}: nothing was measured: no times_s, no log (a log beside the file is found by the name of "
            "its test, such as log_cutting.csv)"
        )
    factors = parse_units(units) if units is not None else None
    logs = {}
    for done, (name, path) in enumerate(sheet.logs.items(), start=1):
        logs[name] = read_log(path, factors)
        if on_progress is not None:
            on_progress(0.5 * done / len(sheet.logs))
    found = fit_logs(sheet.tests, logs) if logs else []
    contradictions: list[str] = []
    if sheet.times_s:
        watch = fit_stopwatch(sheet)
        found, contradictions = combine(found, watch.found), watch.contradictions
    rank = {name: place for place, name in enumerate(_ORDER)}
    facts = sorted([*found, _NOT_SEEN], key=lambda each: rank.get(each.quantity, len(rank)))
    fitted, remarks = _fitted(machine, facts)
    return Characterisation(
        machine=machine.name,
        findings=tuple(replace(each, assumed=_assumed(machine, each)) for each in facts),
        files=(sheet.file, *(str(path) for path in sheet.logs.values())),
        fitted=fitted,
        remarks=remarks,
        warnings=tuple(contradictions),
    )


def _sheet(source: Path) -> FilledSheet:
    """The results behind a RESULTS.toml, a folder with one, or a log beside one."""
    if source.is_dir():
        return read_sheet(source / SHEET)
    if source.suffix.lower() == ".toml":
        return read_sheet(source)
    beside = source.parent / SHEET
    if not beside.is_file():
        raise ArgumentError(f"{source}: no {SHEET} beside it, which says what the program did")
    sheet = read_sheet(beside)
    name = next((name for name, log in sheet.logs.items() if log.resolve() == source.resolve()), source.stem)
    if name not in sheet.tests:
        logs = ", ".join(sorted(each for each, test in sheet.tests.items() if test.kind == "log"))
        raise ArgumentError(f"{source}: {beside} has no test {source.stem}; name the log after its test: {logs}")
    return replace(sheet, times_s={}, logs={name: source})


def _assumed(machine: Machine, fact: ControllerFact) -> float | str | None:
    """What the machine file has for a fact; None where it has no key for it."""
    place: Any = machine
    for name in fact.key.split(".") if fact.key else []:
        inner = getattr(place, name, None)
        if inner is None:  # one value for all axes
            return place if isinstance(place, int | float) else None
        place = inner
    return place if isinstance(place, int | float | str) else None


def _fitted(machine: Machine, facts: Sequence[ControllerFact]) -> tuple[Machine, dict[str, str]]:
    """The machine with everything that is known, and a remark for each key that was set."""
    data = machine.model_dump(exclude_none=True)
    remarks: dict[str, str] = {}
    for_all: dict[str, list[ControllerFact]] = defaultdict(list)
    split = any(each.quantity == "cutting time constant" and each.value is not None for each in facts)
    for fact in facts:
        if fact.value is None or not fact.key or (fact.quantity == CUTTING_SUM and split):
            continue
        head, _, last = fact.key.rpartition(".")
        table = _table(data, head)
        if not isinstance(table, dict):
            for_all[head].append(fact)
            continue
        table[last] = _value(data, fact)
        key = head if last in ("x", "y", "z") else fact.key
        text = f"{last} " if key == head else ""
        text += f"{fact.low:.6g} ... {fact.high:.6g}" if fact.low is not None else "fitted"
        remarks[key] = f"{remarks[key]}, {text}" if key in remarks else f"measured ({fact.source}): {text}"
    for key, several in for_all.items():
        # One value for all axes in the file: their mean.
        halves = [((each.high or 0.0) - (each.low or 0.0)) / 2.0 + 1e-6 for each in several]
        centre, half = mean([float(each.value or 0.0) for each in several], halves)
        head, _, last = key.rpartition(".")
        _table(data, head)[last] = round(centre, 7)
        remarks[key] = f"measured ({several[0].source}), mean of the axes: ± {half:.2g}"
    fitted = Machine.from_data(data, "the machine with the fitted values")
    return fitted.with_remarks(machine.all_remarks() | remarks), remarks


def _table(data: dict[str, Any], dotted: str) -> Any:
    """What stands under a dotted key."""
    place: Any = data
    for name in dotted.split("."):
        place = place[name]
    return place


def _value(data: dict[str, Any], fact: ControllerFact) -> float | str | None:
    """A fact as the machine file states it; the sum of both times leaves the file its bell time where that fits."""
    if not isinstance(fact.value, float):
        return _SHAPES.get(fact.value, fact.value) if isinstance(fact.value, str) else fact.value
    value = fact.value
    if fact.quantity == CUTTING_SUM:
        bell = float(data["controller"]["bell_time_s"])
        data["controller"]["bell_time_s"] = bell if bell < value else 0.0
        value -= bell if bell < value else 0.0
    return round(value, 7)
