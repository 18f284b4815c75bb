"""Figures of docs/evidence/evidence.md, Sinumerik capture: `python tests/benchmarks/evidence_sinumerik.py [CAPTURE]`.

Prints what the servo lag, the same behind a dead time, and the drive leave of the following error; the dead time of the
control's own model; what a shift of one sample does to a gain that is taken from the commanded speed. `--plots DIR`
writes the picture.
"""

from __future__ import annotations

import argparse

import numpy as np
from places import ROOT
from scipy.optimize import minimize_scalar

import shapegcode as sg
from shapegcode.identification.servo.fit import delayed, rms

SHIPPED = ROOT / "python/shapegcode/data/measured/sinumerik/capture.json.gz"


def own_dead_time(capture: sg.EdgeCapture, axis: int) -> tuple[float, float]:
    """Dead time in s that makes command less encoder the control's contour deviation, and what is left (rms)."""
    # Where the contour deviation stands still the control does not follow the position.
    parts = [each for each in capture.stretches if np.ptp(capture.column("DES_POS", axis)[each]) > 0.0]

    def left(samples: float) -> float:
        found = []
        for part in parts:
            late = delayed(capture.position(axis)[part], samples)
            deviation = capture.column("CONT_DEV", axis)[part]
            rest = late - capture.position(axis, actual=True)[part] - deviation
            found.append((rest - np.median(rest))[50:][deviation[50:] != 0.0])
        return rms(np.concatenate(found))

    grid = np.arange(0.0, 10.0, 0.125)
    best = float(min(grid, key=left))
    found = minimize_scalar(left, bounds=(max(0.0, best - 0.125), best + 0.125), method="bounded")
    return float(found.x) * capture.cycle_s, float(found.fun)


def gain_by_speed(capture: sg.EdgeCapture, axis: int, shift: int) -> float:
    """K of CMD_SPEED = s (v + K d), the command's speed v taken some samples earlier."""
    columns, values = [], []
    for part in capture.stretches:
        speed = np.roll(capture.column("VEL_FFW", axis)[part], -shift)
        deviation = capture.column("CONT_DEV", axis)[part]
        columns.append(np.column_stack([speed, deviation, np.ones_like(speed)])[20:-20])
        values.append(capture.column("CMD_SPEED", axis)[part][20:-20])
    weights = np.linalg.lstsq(np.concatenate(columns), np.concatenate(values), rcond=None)[0]
    return float(weights[1] / weights[0])


def main() -> None:
    """Print the figures."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("capture", nargs="?", default=str(SHIPPED))
    parser.add_argument("--plots", metavar="DIR")
    args = parser.parse_args()
    found = sg.fit_servo(args.capture, drive=True)
    print(found.answer, *found.tables(), sep="\n\n")
    capture = sg.read_edge_json(args.capture)
    print("\ndead time of the control's own model, and what it leaves of CONT_DEV")
    for axis in capture.axes:
        dead_s, left = own_dead_time(capture, axis.number)
        print(f"  {axis.number}: {1e3 * dead_s:.3f} ms, {1e3 * left:.3f} µm or mdeg")
    if {"VEL_FFW", "CMD_SPEED"} <= set(capture.axis(2).signals):
        gains = ", ".join(f"{shift}: {gain_by_speed(capture, 2, shift):.1f}" for shift in (-1, 0, 1))
        print(f"\naxis 2: gain by CMD_SPEED, VEL_FFW taken that many samples earlier: {gains} 1/s")
    if args.plots:
        print(*found.save_plots(args.plots))


if __name__ == "__main__":
    main()
