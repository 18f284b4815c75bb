"""What each shaper does to the same programs, all through the conversion: the tables of docs/evidence/comparison.md.

Run from the root of the repository: ``python tests/benchmarks/compare_shapers.py``. The machine is `vx500`; every
figure is of the text that was written, read back and simulated, with the modes where they are and 5 and 10 % off.
"""

from __future__ import annotations

import argparse
import json
import sys
from collections.abc import Callable, Iterable, Iterator, Sequence
from contextlib import nullcontext
from dataclasses import asdict, dataclass, field
from pathlib import Path
from typing import Any
from unittest import mock

import closed_rival
import numpy as np
from places import GOLDEN, ROOT
from table import markdown

import shapegcode as sg
from shapegcode import _core
from shapegcode.cli.runner import progress
from shapegcode.conversion import plan as converter
from shapegcode.machine.programs import ANY_PRICE
from shapegcode.model.machine_model import MachineModel
from shapegcode.shaping import design, machine_bands
from shapegcode.shaping.grid import Grid, choose_grid, make_grid

PROGRAMS = {
    "the path of paper 000, 200 mm/s": ROOT / "python" / "shapegcode" / "data" / "paper_path.nc",
    "PARALLEL.NC": GOLDEN / "PARALLEL.NC",
    "PROGRAM2.NC": GOLDEN / "PROGRAM2.NC",
    "TEST_G90.NC": GOLDEN / "TEST_G90.NC",
}
WIDE_UM, TIGHT_UM = 1000.0, 10.0  # contour tolerances: none of the shapers is slowed by it, all are
BANDS = (0.05, 0.10)
_PLACES = (-1.0, -0.5, 0.0, 0.5, 1.0)  # in a band: some shapers leave most inside of it
_AXES = "xy"


@dataclass(frozen=True)
class Way:
    """A row of the tables."""

    name: str  # how it stands there
    family: str  # of `shaping.family`
    contour: str = "off"  # of `shaping.contour`
    band: float = 0.0  # uncertainty that the machine file states, relative


WAYS = (
    Way("`zv`", "zv"),
    Way("`zvd`", "zvd"),
    Way("`ei`", "ei"),
    Way("`mzv`", "mzv"),
    Way("`smooth-zv`", "smooth-zv"),
    Way("`minimal`, times rounded ¹", "minimal"),
    Way("`non-negative`: exact on the grid", "non-negative"),
    Way("`robust`, ±10 % ²", "robust", band=max(BANDS)),
    Way("`non-negative`, contour kept ³", "non-negative", "response"),
)


@dataclass
class Outcome:
    """What became of a program; µm, ms and s."""

    way: str  # name of the row
    refusal: str = ""  # why there is none; then nothing else is stated
    period_ms: float = 0.0
    shaper_ms: float = 0.0
    # per axis the largest after a stop with modes as stated, and anywhere within each of `BANDS`
    residual_um: dict[str, list[float]] = field(default_factory=dict)
    peak_um: dict[str, float] = field(default_factory=dict)
    command_um: float = 0.0
    response_um: float = 0.0
    cutting_s: float = 0.0
    size_bytes: int = 0
    within_tolerance: bool = True


def machine_of(way: Way, contour_um: float, finer: int = 0) -> sg.Machine:
    """The machine file of a row, words with `finer` more decimals; that a mode is off costs no feed and no verdict."""
    data = sg.Machine.load("vx500").model_dump(exclude_none=True)
    for unit in ("mm", "inch"):
        data["controller"][f"least_increment_{unit}"] *= 10.0**-finer
        data["controller"][f"feed_decimals_{unit}"] += finer
    data["shaping"]["contour"] = way.contour
    if way.family != "minimal":
        data["shaping"]["family"] = way.family
    data["tolerance"]["contour_um"] = contour_um
    data["verdict"]["mode_uncertainty"] = False
    for axis in data["axes"].values():
        for mode in axis["modes"] if way.band else ():
            mode["frequency_uncertainty_percent"] = 100.0 * way.band
    return sg.Machine.from_data(data, f"vx500 for {way.name}").with_values(ANY_PRICE)


def shifted(machine: sg.Machine, share: float) -> sg.Machine:
    """The machine with every mode off by a share of its frequency."""
    data = machine.model_dump(exclude_none=True)
    for axis in data["axes"].values():
        for mode in axis["modes"]:
            mode["frequency_hz"] *= 1.0 + share
    return sg.Machine.from_data(data, f"{machine.name} with modes off by {share:+.1%}")


def rounded_minimal(machine: sg.Machine) -> Grid:
    """The minimal shaper (paper 002) as paper 000 writes it: of continuous times, rounded to the block grid."""
    period_s = choose_grid(machine).block_period_s
    ideal = design("minimal", machine_bands(machine))[0].shaper
    times_s = (np.round(ideal.times_s / period_s) * period_s).tolist()
    return make_grid(period_s, _core.Shaper(times_s, ideal.amplitudes.tolist()), family="minimal")


def convert(program: Path, way: Way, contour_um: float, finer: int = 0) -> Outcome:
    """Convert a program one way, and measure the emitted text."""
    machine = machine_of(way, contour_um, finer)
    try:
        # The conversion has no design that ignores its grid; here it is given one.
        grid = rounded_minimal(machine) if way.family == "minimal" else None
        with mock.patch.object(converter, "choose_grid", lambda *_, **__: grid) if grid else nullcontext():
            conversion = sg.convert(program, machine, shape_all=True)
    except _core.DesignError as error:
        return Outcome(way.name, refusal=str(error))
    report = conversion.to_dict()
    emitted = conversion.emitted.core
    places = [
        (emitted.cutting_path(place.first_line, place.last_line), place.region.path) for place in conversion.placed
    ]

    def play(other: sg.Machine) -> Iterator[_core.SimulationFigures]:
        model = MachineModel(other)
        for blocks, path in places:
            yield model.simulate_emitted(blocks, path, contour=False, last_seconds=model.vibration_memory_s)

    return Outcome(
        way.name,
        period_ms=1e3 * report["block_period_s"],
        shaper_ms=1e3 * report["shaper"]["times_s"][-1],
        residual_um=_over_bands(machine, play),
        peak_um=report["peak_vibration_um"]["emitted"],
        command_um=report["contour_error_um"]["command"]["emitted"]["max"],
        response_um=report["contour_error_um"]["response"]["emitted"]["max"],
        cutting_s=report["cutting_time_s"]["emitted"],
        size_bytes=report["bytes_emitted"],
        within_tolerance=conversion.ok,
    )


def as_programmed(program: Path) -> Outcome:
    """The program itself under the controller's own motion."""
    machine = sg.Machine.load("vx500")
    read = sg.Program.read(program, machine)
    paths = [region.path for region in read.regions]
    runs = [MachineModel(machine).simulate_original(path) for path in paths]
    return Outcome(
        "as programmed",
        residual_um=_over_bands(machine, lambda other: (MachineModel(other).simulate_original(path) for path in paths)),
        peak_um=_largest_um(run.peak_mm for run in runs),
        command_um=1e3 * max(run.command.max_abs_mm for run in runs),
        response_um=1e3 * max(run.response.max_abs_mm for run in runs),
        cutting_s=sum(run.duration_s for run in runs),
        size_bytes=read.core.size,
    )


def _over_bands(
    machine: sg.Machine, play: Callable[[sg.Machine], Iterable[_core.SimulationFigures]]
) -> dict[str, list[float]]:
    """Largest residual of each axis, modes as stated and within each band."""
    at = {
        share: _largest_um(run.residual_mm for run in play(shifted(machine, share)))
        for share in sorted({place * band for band in BANDS for place in _PLACES})
    }
    bands = (0.0, *BANDS)
    return {
        axis: [max(found[axis] for share, found in at.items() if abs(share) <= band + 1e-12) for band in bands]
        for axis in _AXES
    }


def _largest_um(rows: Iterable[Any]) -> dict[str, float]:
    return dict(zip("xyz", (1e3 * np.max(list(rows), axis=0)).tolist(), strict=True))


def full_table(outcomes: Sequence[Outcome]) -> str:
    """One program with a wide contour tolerance: what each shaper leaves and costs by itself."""
    before = outcomes[0].cutting_s
    head = ["shaper", "T, ms", "duration, ms", "residual X", "residual Y", "peak X, Y", "command", "response"]
    rows = []
    for each in outcomes:
        if each.refusal:
            rows.append([each.way, "–", "–", f"none: {each.refusal}", *["–"] * 6])
            continue
        residuals = [" / ".join(map(_um, each.residual_um[axis])) for axis in _AXES]
        rows.append(
            [
                each.way, *((f"{each.period_ms:g}", f"{each.shaper_ms:g}") if each.shaper_ms else ("–", "–")),
                *residuals, ", ".join(_um(each.peak_um[axis]) for axis in _AXES),
                _um(each.command_um), _um(each.response_um), _time(each, before), str(each.size_bytes),
            ]
        )  # fmt: skip
    return markdown([*head, "cutting time, s", "bytes"], rows)


def tight_table(programs: Sequence[str], columns: Sequence[Sequence[Outcome]], before_s: Sequence[float]) -> str:
    """Every program with a tight contour tolerance: the time that each shaper needs to keep it."""
    rows = []
    for line in zip(*columns, strict=True):
        cells = [line[0].way]
        for each, before in zip(line, before_s, strict=True):
            kept = "" if each.within_tolerance else " **missed**"
            cells.append("none" if each.refusal else f"{each.cutting_s - before:+.2f}{kept}")
            cells.append("–" if each.refusal else f"{_um(each.command_um)} / {_um(each.response_um)}")
        rows.append(cells)
    return markdown(["shaper", *(head for name in programs for head in (name, "command / response"))], rows)


def _um(value: float) -> str:
    return f"{value:.1f}" if value >= 0.05 else "0"


def _time(each: Outcome, before_s: float) -> str:
    return f"{each.cutting_s:.2f}" + (f" ({each.cutting_s - before_s:+.2f})" if each.shaper_ms else "")


def _ideal_note() -> str:
    """What rounding does to the minimal shaper."""
    machine = machine_of(next(way for way in WAYS if way.family == "minimal"), WIDE_UM)
    bands = machine_bands(machine)
    ideal = design("minimal", bands)[0].shaper
    grid = rounded_minimal(machine)

    def leaves(shaper: _core.Shaper) -> str:
        return " and ".join(
            f"{100 * shaper.residual_ratio(band.mode):.1f} % of {band.mode.frequency_hz:g} Hz" for band in bands
        )

    times, taken = (", ".join(f"{1e3 * t:.4g}" for t in shaper.times_s) for shaper in (ideal, grid.shaper))
    return (
        f"¹ Designed at {times} ms, which leaves {leaves(ideal)}; written at {taken} ms, which leaves "
        f"{leaves(grid.shaper)}."
    )


def main() -> int:
    """Print the tables as Markdown."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument(
        "--finer", type=int, default=0, metavar="N", help="words with N more decimals than the machine's"
    )
    parser.add_argument("--json", type=Path, metavar="FILE", help="write every figure to FILE")
    parser.add_argument("--bands", action="store_true", help="only the bands and durations beside the closed rival")
    arguments = parser.parse_args()
    if arguments.bands:
        print(closed_rival.tables())
        return 0

    wide: dict[str, list[Outcome]] = {}
    tight: dict[str, list[Outcome]] = {}
    steps = len(PROGRAMS) * (1 + 2 * len(WAYS))
    done = 0
    with progress("comparing shapers", arguments) as bar:

        def advance() -> None:
            nonlocal done
            done += 1
            bar.update(done / steps)

        for name, path in PROGRAMS.items():
            wide[name], tight[name] = [as_programmed(path)], []
            advance()
            for way in WAYS:
                wide[name].append(convert(path, way, WIDE_UM, arguments.finer))
                advance()
                tight[name].append(convert(path, way, TIGHT_UM, arguments.finer))
                advance()
    for name, outcomes in wide.items():
        print(f"**{name}**, contour tolerance {WIDE_UM:g} µm\n\n{full_table(outcomes)}\n")
    before_s = [outcomes[0].cutting_s for outcomes in wide.values()]
    print(f"**Contour tolerance {TIGHT_UM:g} µm**: seconds longer than as programmed\n")
    print(tight_table(list(PROGRAMS), list(tight.values()), before_s), end="\n\n")
    print(_ideal_note(), end="\n\n")
    print(closed_rival.tables())
    if arguments.json:
        figures = {
            name: {f"{WIDE_UM:g} um": [asdict(each) for each in wide[name]],
                   f"{TIGHT_UM:g} um": [asdict(each) for each in tight[name]]}
            for name in PROGRAMS
        }  # fmt: skip
        arguments.json.write_text(json.dumps(figures, indent=2, ensure_ascii=False) + "\n", encoding="utf-8")
    return 0


if __name__ == "__main__":
    sys.exit(main())
