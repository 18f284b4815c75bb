"""Machines whose modes move other axes than those which excite them, and their tools by the judge's plant."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import numpy.typing as npt

import shapegcode as sg
from judge import Mode
from judge.draws import Draw, draw
from judge.plant import relative_motion

Vector = npt.NDArray[np.float64]
PERIOD_S = 1e-3
ROCKING = {
    "axes.y.modes.1.frequency_hz": 30.0, "axes.y.modes.1.moves": {"y": 0.2, "z": 0.035},
    "axes.z.rigid": True, "tolerance.contour_um": 10.0, "price.program_time_percent": 100.0,
    "price.cut_time_percent": 100.0,
}  # fmt: skip
_STEPS = "".join(f"G1 X{4 * k + 2} F3000\nG1 Y{60 * (1 - k % 2)} F6000\nG1 X{4 * k + 4} F3000\n" for k in range(4))
ZIGZAG = f"%\nO1\nG90 G21 G17 G40 G54\nG0 X0 Y0 Z5\nG1 Z-1 F500\n{_STEPS}G3 X16 Y0 I-20 J0 F6000\nG0 Z5\nM30\n%\n"


def deflection(command: Vector, frequency_hz: float, damping_ratio: float) -> Vector:
    """Of a mode that is excited by the acceleration of a command which is linear between samples."""
    return relative_motion(command, Mode(frequency_hz, damping_ratio), PERIOD_S)


def largest_z_um(text: str, machine: sg.Machine) -> float:
    """Largest distance of the tool from its depth in the cut at Z -1, by that plant behind the command."""
    run = max(sg.simulate(sg.Program.from_text(text, machine), machine).regions, key=lambda region: region.time_s)
    command = run.command_mm
    mode = machine.axes.y.modes[0]
    assert mode.moves is not None
    z = command[:, 2] + mode.moves.z * deflection(command[:, 1], 30.0, mode.damping_ratio)
    deep = np.flatnonzero(command[:, 2] < -0.98)[0] + 100
    return 1e3 * float(np.abs(z[deep:] + 1.0).max())


def skewed_draw(seed: int) -> Draw:
    """A program at random on a machine whose modes are excited and move as they like."""
    drawn, rng = draw(seed), np.random.default_rng([7, seed])

    def direction(own: int) -> dict[str, float]:
        shares = 0.5 * rng.normal(size=3)
        shares[rng.random(3) < 0.3] = 0.0
        shares[own] = rng.choice([-1.0, 1.0]) * rng.uniform(0.5, 1.5)
        return dict(zip("xyz", np.round(shares, 3).tolist(), strict=True))

    keys = {
        f"axes.{letter}.modes": [
            {
                "frequency_hz": round(float(rng.uniform(20.0, 140.0)), 1),
                "damping_ratio": round(float(rng.uniform(0.01, 0.06)), 3),
                "excited_by": direction(axis), "moves": direction(axis),
            }
        ]
        for axis, letter in enumerate("xy")
    }  # fmt: skip
    return replace(drawn, keys=drawn.keys | keys)
