"""From results to findings, and from findings to a machine file."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

from shapegcode._core import ArgumentError
from shapegcode.characterization.findings import CUTTING_SUM, Finding, combine, mean
from shapegcode.characterization.log import read_log
from shapegcode.characterization.logfit import fit_logs
from shapegcode.characterization.results import Results, read_results
from shapegcode.characterization.stopwatch import fit_stopwatch

if TYPE_CHECKING:
    from shapegcode.machine import Machine

__all__ = ["Fit", "applied", "assumed_value", "fit"]

_RESULTS = "RESULTS.toml"
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
_NOT_SEEN = Finding(
    "motion",
    None,
    None,
    None,
    "",
    "",
    "",
    "straight moves between stops look the same with and without look-ahead: a setting, not a finding",
)


@dataclass(frozen=True)
class Fit:
    """What the results say.

    Attributes:
        findings: one for each quantity, known or not.
        contradictions: times that do not go with the others, in words.
        read: the files that were read.
    """

    findings: list[Finding]
    contradictions: list[str]
    read: list[Path]


def _results(source: Path) -> Results:
    """The results behind a RESULTS.toml, a folder with one, or a log beside one."""
    if source.is_dir():
        return read_results(source / _RESULTS)
    if source.suffix.lower() == ".toml":
        return read_results(source)
    beside = source.parent / _RESULTS
    if not beside.is_file():
        raise ArgumentError(f"{source}: no {_RESULTS} beside it, which says what the program did")
    results = read_results(beside)
    name = next((name for name, log in results.logs.items() if log.resolve() == source.resolve()), source.stem)
    if name not in results.tests:
        logs = ", ".join(sorted(each for each, test in results.tests.items() if test.kind == "log"))
        raise ArgumentError(f"{source}: {beside} has no test {source.stem}; name the log after its test: {logs}")
    return Results(
        results.file,
        results.tests,
        {},
        {name: source},
        results.resolution_s,
        results.reaction_s,
        results.lines,
    )


def fit(
    source: Path,
    units: tuple[float, float] | None = None,
    on_progress: Callable[[float], None] | None = None,
) -> Fit:
    """Fit all that was measured.

    Args:
        source: a filled-in RESULTS.toml, the folder that holds it and the logs, or one log beside it.
        units: of the logs, factors to s and mm; None: from their headers.
        on_progress: told the share of the work done.

    Raises:
        ArgumentError: bad input, with file, line, value and limit.
        OSError: a file cannot be read.
    """
    results = _results(source)
    if not results.times_s and not results.logs:
        raise ArgumentError(
            f"{results.file}: nothing was measured: no times_s, no log (a log beside the file is found by the name of "
            "its test, such as log_cutting.csv)"
        )
    logs = {}
    for done, (name, path) in enumerate(results.logs.items()):
        logs[name] = read_log(path, units)
        if on_progress is not None:
            on_progress(0.5 * (done + 1) / len(results.logs))
    from_logs = fit_logs(results.tests, logs) if logs else []
    watch = fit_stopwatch(results) if results.times_s else None
    findings = combine(from_logs, watch.findings) if watch else from_logs
    findings.append(_NOT_SEEN)
    rank = {name: place for place, name in enumerate(_ORDER)}
    findings.sort(key=lambda each: rank.get(each.quantity, len(rank)))
    return Fit(findings, watch.contradictions if watch else [], [Path(results.file), *results.logs.values()])


def assumed_value(machine: Machine, finding: Finding) -> object:
    """What the machine file has for a finding; None where it has no key for it."""
    place: Any = machine
    for name in finding.key.split(".") if finding.key else []:
        inner = getattr(place, name, None)
        if inner is None:
            return place if isinstance(place, int | float) else None
        place = inner
    return place if isinstance(place, int | float | str) else None


def applied(machine: Machine, findings: Sequence[Finding]) -> tuple[Machine, dict[str, str]]:
    """The machine with everything that is known, and a remark for each key that was set.

    Raises:
        MachineError: the values do not go with others of the machine file; the message names both.
    """
    from shapegcode.machine import Machine

    data = machine.model_dump(exclude_none=True)
    remarks: dict[str, str] = {}
    split = any(each.quantity == "cutting time constant" and each.value is not None for each in findings)
    for_all: dict[str, list[Finding]] = {}
    for finding in findings:
        if finding.value is None or not finding.key or (finding.quantity == CUTTING_SUM and split):
            continue
        value: float | str = finding.value
        if isinstance(value, str):
            value = _SHAPES.get(value, value)
        elif finding.quantity == CUTTING_SUM:
            bell = float(data["controller"]["bell_time_s"])
            value = value - bell if bell < value else value
            data["controller"]["bell_time_s"] = bell if bell < finding.value else 0.0  # type: ignore[operator]
        head, _, last = finding.key.rpartition(".")
        place = data
        *tables, table = head.split(".")
        for name in tables:
            place = place[name]
        if not isinstance(place[table], dict):
            for_all.setdefault(head, []).append(finding)
            continue
        place[table][last] = round(value, 7) if isinstance(value, float) else value
        key = head if last in ("x", "y", "z") else finding.key
        text = f"{last} " if key == head else ""
        text += f"{finding.low:.6g} ... {finding.high:.6g}" if finding.low is not None else "fitted"
        remarks[key] = f"{remarks[key]}, {text}" if key in remarks else f"measured ({finding.source}): {text}"
    for key, several in for_all.items():
        # One value for all axes in the file: their mean.
        halves = [((each.high or 0.0) - (each.low or 0.0)) / 2.0 + 1e-6 for each in several]
        centre, half = mean([float(each.value) for each in several], halves)  # type: ignore[arg-type]
        table, _, last = key.rpartition(".")
        data[table][last] = round(centre, 7)
        remarks[key] = f"measured ({several[0].source}), mean of the axes: ± {half:.2g}"
    return Machine.from_data(data, "the machine with the fitted values"), remarks
