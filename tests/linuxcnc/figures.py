"""The figures of docs/howto/linuxcnc.md: python tests/linuxcnc/figures.py"""

from __future__ import annotations

import re
import tempfile
from pathlib import Path

import analysis
import linuxcnc_run
import machine
import numpy as np


def main() -> None:
    """Run the program once and print what the recording says."""
    with tempfile.TemporaryDirectory() as place:
        program = machine.contour_program(Path(place))
        recorded = linuxcnc_run.run(linuxcnc_run.as_user(), program, override=machine.FEED_OVERRIDE)
    command, shaped = recorded.command, recorded.shaped
    error = np.abs(shaped - analysis.convolved(command, machine.both_modes())).max()
    print(f"{len(command)} samples; output against the convolution of the input: {error:.1e} mm at most")
    for axis, (frequency_hz, damping) in enumerate(machine.MODES):
        for off in (1.0, 0.95, 1.05):
            mode = (off * frequency_hz, damping)
            pair = [1e3 * analysis.swing_when_steady(signal[:, axis], *mode) for signal in (command, shaped)]
            print(f"{'XY'[axis]}, {mode[0]:g} Hz: largest swing at rest and steady speed {pair[0]:.2f} um, "
                  f"shaped {pair[1]:.2g} um")  # fmt: skip
    cutting = np.abs(command[:, 2] - machine.DEPTH_MM) < 1e-6
    print("deviation from the programmed path while cutting, in um: largest, root of the mean square")
    for name, points in (
        ("table as commanded", machine.table(command)),
        ("table shaped", machine.table(shaped)),
        ("shaped command", shaped),
    ):
        away = 1e3 * analysis.deviation(points, command)[cutting]
        print(f"  {name}: {away.max():.1f}, {np.sqrt(np.mean(away**2)):.2f}")
    mhz = float(re.findall(r"cpu MHz\s*: ([\d.]+)", Path("/proc/cpuinfo").read_text())[0])
    thread, component = linuxcnc_run.longest_cycles(recorded.said)
    shares = np.percentile(recorded.cycles, [50, 99, 100])
    print(f"component, in us at {mhz:g} MHz: median {shares[0] / mhz:.1f}, 99 % {shares[1] / mhz:.1f}, "
          f"longest {component / mhz:.1f}; longest servo thread {thread / mhz:.0f}")  # fmt: skip


if __name__ == "__main__":
    main()
