"""Modes across axes: rocking in Z from motion in Y, and the verdict on machines at random beside an independent plant.

Run from the root of the repository: ``python tests/benchmarks/crossing_modes.py`` (docs/concepts/crossing_modes.md).
"""

from __future__ import annotations

import argparse

import places  # noqa: F401

import random_verdict
import shapegcode as sg
from crossing_machines import ROCKING, ZIGZAG, largest_z_um, skewed_draw
from random_verdict import complaints, convert

_AGREE_UM = 0.1


def main() -> None:
    """Measure and print."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("--draws", type=int, default=100, help="machines at random (100)")
    arguments = parser.parse_args()
    print("| increment | program | largest Z error | cutting time |")
    print("|---|---|---|---|")
    for increment_mm in (1e-3, 1e-4):
        _rocking(increment_mm)
    random_verdict.ABSOLUTE_UM = _AGREE_UM
    regions, found = 0, []
    for seed in range(arguments.draws):
        case = convert(skewed_draw(seed), shape_all=True)
        regions += len(case.regions)
        found += [f"seed {seed}: {what}" for what in complaints(case)]
    print(
        f"{arguments.draws} machines at random, {regions} shaped cuts: {len(found)} figures of the verdict differ from "
        f"the independent plant's by more than 5 % or {_AGREE_UM:g} um"
    )
    print("\n".join(found))


def _rocking(increment_mm: float) -> None:
    machine = sg.Machine.load("vx500").with_values({**ROCKING, "controller.least_increment_mm": increment_mm})
    original_um = largest_z_um(ZIGZAG, machine)
    for contour, name in (("command", "shaped"), ("response", "shaped, Z fed forward")):
        chosen = machine.with_values("shaping.contour", contour)
        result = sg.convert(sg.Program.from_text(ZIGZAG, chosen), chosen)
        times, cell = result.cutting_time_s, f"{increment_mm * 1e3:g} µm"
        if contour == "command":
            print(f"| {cell} | original | {original_um:.1f} µm | {times.original:.2f} s |")
        left_um = largest_z_um(result.text.decode(), chosen)
        print(f"| {cell} | {name} | {left_um:.1f} µm | {times.emitted:.2f} s |")


if __name__ == "__main__":
    main()
