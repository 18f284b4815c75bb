"""What a program would shake on a machine without a known mode: there is nothing to shape for, and no verdict.

What matters then is which axis to tap first.
"""

from __future__ import annotations

from pathlib import Path

from shapegcode.conversion.rests import RestsOn, unknown_axes
from shapegcode.machine import Machine
from shapegcode.program import Program
from shapegcode.simulation.simulate import simulate


def open_axes(program: Program | str | Path, machine: Machine) -> tuple[RestsOn, ...]:
    """Axes that may have a mode or not, by how much a usual mode would vibrate behind the program as it is."""
    unknown = unknown_axes(machine)
    assumed = {
        key: value
        for letter in unknown
        for key, value in ((f"axes.{letter}.rigid", False), (f"axes.{letter}.modes", unknown[letter].modes))
    }
    simulated = simulate(program, machine.with_values(assumed) if assumed else machine, record_samples=0)
    rows = [
        RestsOn(
            axis.value.key, "none", "assumed", axis.moved, f"residual vibration {letter.upper()}", 0.0,
            getattr(simulated.residual_vibration_um, letter), machine.tolerance.residual_floor_um,
        )
        for letter, axis in unknown.items()
    ]  # fmt: skip
    return tuple(sorted(rows, key=lambda row: -row.moved_um))
