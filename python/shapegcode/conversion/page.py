"""The page of a conversion: whether to run it, before and after, sensitivity, and the operator's run sheet."""

from __future__ import annotations

import hashlib
import re
from collections.abc import Iterator
from pathlib import Path
from typing import TypeVar

from shapegcode.conversion.operating import restart_table
from shapegcode.conversion.plan import curve_table
from shapegcode.conversion.result import Conversion
from shapegcode.conversion.scheduled import ScheduledConversion
from shapegcode.conversion.tables import CutOutcome, before_after_table, sensitivity_table
from shapegcode.machine import Machine
from shapegcode.results.json import Provenance
from shapegcode.results.outcome import Pair
from shapegcode.results.page import model
from shapegcode.results.page.model import next_steps, pictures_of, warnings_of
from shapegcode.results.table import Column, Table
from shapegcode.verdict.figures import CaseVerdict

N = TypeVar("N", int, float)

_MIN_SHOWN_UM = 0.05


def light_of(conversion: Conversion) -> tuple[model.Light, str]:
    """Colour of the traffic light, and the reason."""
    if not conversion.is_written_as_output:
        return "red", conversion.reason
    if not conversion.within_tolerance:
        return "amber", next(conversion.misses(), conversion.reason)
    if conversion.nothing_shaped:
        return "calm", conversion.reason
    turning = [row.key for row in conversion.parameter_sensitivity if row.tested_um > row.limit_um]
    if turning:
        return "amber", f"an unverified parameter of this machine could change the verdict: {turning[0]}"
    if count := len(conversion.warnings):
        return "amber", f"{count} warning{'s' if count > 1 else ''} to resolve first"
    return "green", f"every tolerance is kept in all {sum(case.counts for case in conversion.cases)} cases that count"


def sections_of(conversion: Conversion, provenance: Provenance | None = None) -> Iterator[model.Section]:
    """The sections of the page."""
    how = "Each card: original → emitted. The limit applies to the emitted program."
    yield model.Section("gain", "Before and after", (model.Figures(tuple(_figures(conversion))),), how=how)
    if conversion.proof is not None:
        how = "The emitted program was re-read and compared with the original, as by shapegcode compare."
        yield model.Section("proof", "What did not change", (model.Text((conversion.proof.answer,)),), how=how)
    yield from warnings_of(conversion)
    yield next_steps(conversion, *_further(conversion))
    if conversion.cases:
        yield _cases(conversion)
    if conversion.parameter_sensitivity:
        table = sensitivity_table(conversion.parameter_sensitivity, conversion.unverified_parameters_tested)
        how = "Measure the first one first: it changes the verdict most. Red: it could change the verdict."
        yield model.Section("rests", "Sensitivity to unverified parameters", (table,), how=how)
    yield from _price(conversion, provenance)
    yield _times(conversion)
    if isinstance(conversion, ScheduledConversion):
        yield model.Section(
            "feeds", "Feeds and cutting forces", tuple(conversion.feed_schedule.tables()), printed=False
        )
    if not conversion.nothing_shaped:
        table = before_after_table(conversion.before_after())
        yield model.Section("figures", "All figures, before and after", (table,), folded=True, printed=False)
    if conversion.simulated is not None:
        yield _machine(conversion.simulated.machine)
    yield from pictures_of(conversion, ("path", "vibration"))
    if conversion.at_the_control:
        yield _sheet(conversion, provenance)


def _picker(conversion: Conversion, provenance: Provenance | None) -> model.CutPicker:
    """Make the picker of cuts; a cut that was not shaped has no emitted figures."""
    rows = [
        model.CutRow(
            cut.lines, "" if cut.tool is None else f"T{cut.tool}", cut.gain_um, _tried(cut.residual_um, cut),
            _tried(cut.contour_um, cut), _tried(cut.time_s, cut), _tried(cut.bytes, cut),
            "shaped" if cut.is_shaped else cut.reason, cut.is_shaped, cut.is_shaped,
        )
        for cut in conversion.cuts
    ]  # fmt: skip
    command = ("" if provenance is None else provenance.command) or "shapegcode convert IN -m MACHINE -o OUT"
    command = re.sub(r" --(?:only|leave)[ =]\S+", "", command)
    totals = model.CutTotals(
        conversion.cycle_time_s.original,
        conversion.bytes_read,
        min(max(cut.residual_limit_um) for cut in conversion.all_cuts),
        conversion.limits.contour_um,
    )
    return model.CutPicker(tuple(rows), f"{command} --only {{lines}}", totals)


def _tried(pair: Pair[N], cut: CutOutcome) -> Pair[N | None]:
    return Pair(pair.original, pair.emitted if cut.is_shaped else None)


def _price(conversion: Conversion, provenance: Provenance | None) -> Iterator[model.Section]:
    if len(conversion.cuts) > 1:
        how = "The command below shapes only the ticked cuts. Gain: the larger reduction of residual and contour."
        parts, many = (_picker(conversion, provenance),), len(conversion.cuts) > 12
        yield model.Section("cuts", "Cut by cut", parts, how=how, folded=many, printed=False)
    if conversion.tolerance_curve is not None:
        sentence = conversion.tolerance_curve.sentence
        how = f"{sentence}. " if sentence else ""
        how += "The time at the requested tolerance was simulated, other times are estimated. Limits: table [price]."
        yield model.Section("price", "Tolerance against time", (curve_table(conversion.tolerance_curve),), how=how)


def _figures(conversion: Conversion) -> Iterator[model.Figure]:
    residual = conversion.residual_vibration_um
    for axis in "xyz":
        if max(residual.original[axis], residual.emitted[axis]) >= _MIN_SHOWN_UM:
            yield model.Figure(
                f"residual vibration {axis.upper()}", "µm", residual.original[axis], residual.emitted[axis],
                limit=conversion.residual_limit_um(axis),
                key_before=f"residual_vibration_um.original.{axis}", key_after=f"residual_vibration_um.emitted.{axis}",
            )  # fmt: skip
    target = conversion.limits.contour_target
    error = getattr(conversion.contour_error_um, target)
    key = f"contour_error_um.{target}"
    yield model.Figure(
        "contour error" + (" of the machine table" if target == "response" else " of the command"), "µm",
        error.original.max, error.emitted.max, limit=conversion.limits.contour_um,
        key_before=f"{key}.original.max", key_after=f"{key}.emitted.max",
    )  # fmt: skip
    time = conversion.cycle_time_s
    yield model.Figure(
        "cycle time", "s", time.original, time.emitted, digits=2,
        key_before="cycle_time_s.original", key_after="cycle_time_s.emitted",
    )  # fmt: skip
    yield model.Figure(
        "size of the program", "kB", conversion.bytes_read / 1e3, conversion.bytes_emitted / 1e3,
        key_before="bytes_read", key_after="bytes_emitted", factor=1e-3,
    )  # fmt: skip


def _further(conversion: Conversion) -> Iterator[model.NextStep]:
    for note in conversion.at_the_control:
        if note.topic == "look-ahead" or "override" in note.topic:
            yield model.NextStep(f"At the control, {note.topic}: {note.text}.")
    if conversion.parameter_sensitivity:
        key = conversion.parameter_sensitivity[0].key
        text = f"Measure {key}: of the unverified parameters, the verdict depends most on this one."
        yield model.NextStep(text, "shapegcode identify --tap-plan -m MACHINE.toml" if ".modes" in key else "")


def _cases(conversion: Conversion) -> model.Section:
    axes = [axis for axis in "xyz" if any(case.residual_um[axis] >= _MIN_SHOWN_UM for case in conversion.cases)]
    columns = (*(f"residual {axis.upper()} µm" for axis in axes), "contour, command µm", "contour, machine table µm",
               "worst figure, % of its limit")  # fmt: skip
    rows = tuple(_case(rank, case, axes, conversion) for rank, case in enumerate(conversion.cases))
    how = (
        "Each row is an operating condition. The colour is the ratio to the limit: up to 100 % is within. One in "
        "brackets does not count in the verdict; if override or modes differ, shaped cuts only."
    )
    counted = sum(case.counts for case in conversion.cases)
    caption = f"{counted} of {len(rows)} operating conditions count (table [verdict] of the machine file)"
    heat = model.HeatMap(columns, rows, 1, caption, factors=(*(1.0 for _ in axes), 1.0, 1.0, 100.0))
    return model.Section("cases", "Operating conditions", (heat,), how=how)


def _case(rank: int, case: CaseVerdict, axes: list[str], conversion: Conversion) -> model.HeatRow:
    errors = {"command": case.contour_error_um.command, "response": case.contour_error_um.response}
    share = None if case.share_of_limit is None else case.share_of_limit * 100.0
    judged = {conversion.limits.contour_target: conversion.limits.contour_um}
    limits = [*map(conversion.residual_limit_um, axes), *map(judged.get, errors)]
    measured = [*(case.residual_um[axis] for axis in axes), *errors.values()]
    shares = [
        each / limit if each is not None and limit else None for each, limit in zip(measured, limits, strict=True)
    ]
    worst = " ← decides" if case is conversion.worst_case else ""
    remark = ("within" if case.within else "OUT") + worst
    names = (*(f"residual_um.{axis}" for axis in axes), "contour_error_um.command", "contour_error_um.response",
             "share_of_limit")  # fmt: skip
    keys = tuple(f"cases.{rank}.{name}" for name in names)
    return model.HeatRow(case.name, (*measured, share), (*shares, case.share_of_limit), remark, case.counts, keys)


def _times(conversion: Conversion) -> model.Section:
    whole, cutting = conversion.cycle_time_s, conversion.cutting_time_s
    rest = Pair(whole.original - cutting.original, whole.emitted - cutting.emitted)
    times = [("whole program", whole, "cycle_time_s"), ("cuts together", cutting, "cutting_time_s")]
    times.append(("everything else", rest, ""))
    longest = sorted(enumerate(conversion.regions), key=lambda ranked: -ranked[1].time_s.emitted)[:8]
    for rank, region in longest if len(conversion.regions) > 1 else []:
        times.append(("cut in lines {} to {}".format(*region.lines), region.time_s, f"regions.{rank}.time_s"))
    rows = tuple((name, (pair.original, pair.emitted)) for name, pair, _ in times)
    keys = tuple((f"{key}.original", f"{key}.emitted") if key else ("", "") for _, _, key in times)
    how = "Two bars for each part: the original above the emitted program."
    bars = model.Bars("s", rows, ("original", "emitted"), digits=2, keys=keys)
    return model.Section("time", "Where the time goes", (bars,), how=how)


def _machine(machine: Machine) -> model.Section:
    """Machine data used: axes, tolerances, settings of the verdict, and all values that are assumed or inherited."""
    shown = ("axes.", "tolerance.", "verdict.")
    values = [value for value in machine.values() if value.unmeasured or value.key.startswith(shown)]
    unmeasured = sum(value.unmeasured for value in values)
    columns = (
        Column("key", left=True),
        Column("value", value=lambda row: f"{row.value} {row.unit if row.unit != '1' else ''}".strip(), text=True),
        Column("origin", value=lambda row: "assumed" if row.assumed else row.origin, text=True),
        Column("meaning", text=True),
    )
    how = f"{unmeasured} of these values were not measured on this machine: assumed or inherited."
    table = Table("", columns, values, row_style=lambda row: "" if row.unmeasured else "bold")
    return model.Section("machine", "Machine data used", (table,), how=how, folded=True, printed=False)


def _sheet(conversion: Conversion, provenance: Provenance | None) -> model.Section:
    """The run sheet for the operator, one page."""
    output = None if provenance is None else provenance.file("output")
    name = f"{Path(conversion.program).name}, shaped" if output is None else Path(output.name).name
    if output is not None:
        sha256 = output.sha256
    else:
        sha256 = "not known" if conversion.is_read_back else hashlib.sha256(conversion.text).hexdigest()
    rows = [("load program", f"{name}, for {conversion.machine}, {conversion.bytes_emitted} bytes")]
    rows.append(("SHA-256 of the program", sha256))
    for role, name in (("input", "original program"), ("machine", "machine file")):
        if provenance is not None and (file := provenance.file(role)) is not None:
            rows.append((name, f"{Path(file.name).name}, SHA-256 {file.sha256 or 'not known'}"))
    rows += [(note.topic, note.text) for note in conversion.at_the_control]
    strong = frozenset(topic for topic, _ in rows if topic == "first run" or "override" in topic)
    title = f"Run sheet: {conversion.recommendation}"
    how = "For the operator. Check it from top to bottom before cycle start."
    points = (restart_table(conversion.restart_points),) if conversion.restart_points else ()
    return model.Section("sheet", title, (model.Notes(tuple(rows), strong), *points), how=how, sheet=True)
