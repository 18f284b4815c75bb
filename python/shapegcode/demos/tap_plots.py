"""The pictures of ``shapegcode demo tap``: figures 2 and 3 of paper 003, and what end mill and collet deflect."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import numpy as np

from shapegcode.demos.tap import TapDemo
from shapegcode.results import plot as canvas

__all__ = ["plot_acceleration", "plot_deflection", "write_demo_pictures"]

_SHOWN_S = 2.5
_SHOWN_HZ = 20.0


def write_demo_pictures(demo: TapDemo, folder: str | Path) -> list[str]:
    """Write the pictures as PNG and SVG into a folder, which is made where it is missing.

    Returns:
        The files written.

    Raises:
        OSError: the folder cannot be made or a file not be written.
    """
    pictures: dict[str, Callable[[Path], None]] = {
        "figures2-3-acceleration": lambda file: plot_acceleration(file, demo),
        "deflection": lambda file: plot_deflection(file, demo),
    }
    return canvas.write_pictures(folder, "paper003", pictures)


def plot_acceleration(file: str | Path, demo: TapDemo) -> None:
    """Acceleration of the 5 kg body after 1 N·s, and its spectrum.

    Raises:
        ValueError: a wrong ending.
        OSError: the file cannot be written.
    """
    count = len(demo.acceleration)
    time_s = demo.period_s * np.arange(count)
    frequency = np.fft.rfftfreq(count, demo.period_s)
    amplitude = 2.0 / count * np.abs(np.fft.rfft(demo.acceleration))
    figure = canvas.figure(10.0, 4.0)
    (left,), (right,) = canvas.panels(figure, 1, 2)
    left.plot(time_s, demo.acceleration, color=canvas.COLOURS[1], linewidth=1.2)
    left.set_xlim(0.0, _SHOWN_S)
    left.set_xlabel("time in s")
    left.set_ylabel("acceleration in m/s²")
    right.plot(frequency, amplitude, color=canvas.COLOURS[1], linewidth=1.2)
    right.set_xlim(0.0, _SHOWN_HZ)
    right.set_ylim(0.0, 1.15 * float(amplitude.max()))
    right.set_xlabel("frequency in Hz")
    right.set_ylabel("amplitude in m/s²")
    peak = int(np.argmax(amplitude))
    hertz = demo.report["system"]["frequency_hz"]
    right.annotate(
        f"{hertz:.2f} Hz", (frequency[peak], amplitude[peak]), (0, 5), textcoords="offset points", ha="center"
    )
    canvas.heading(figure, "5 kg, 20 N·s/m, 4000 N/m after 1 N·s (figures 2 and 3)", "")
    canvas.save(figure, file)


def plot_deflection(file: str | Path, demo: TapDemo) -> None:
    """Deflection of end mill and collet in series under 100 N, and the share of each.

    Raises:
        ValueError: a wrong ending.
        OSError: the file cannot be written.
    """
    series = demo.report["series"]
    figure = canvas.figure(9.0, 2.4)
    panel = canvas.panels(figure, 1, 1)[0][0]
    begin = 0.0
    for number, name in enumerate(("end_mill", "collet")):
        width = series[f"{name}_um"]
        share = series[f"{name}_share_percent"]
        label = f"{name.replace('_', ' ')}: {width:.3g} µm, {share:.1f} %"
        panel.barh(0.0, width, left=begin, height=0.6, color=canvas.COLOURS[number], label=label)
        begin += width
    panel.set_yticks([])
    panel.set_ylim(-0.5, 0.5)
    panel.set_xlabel("deflection of the tip in µm")
    canvas.legend_above(panel)
    canvas.heading(figure, f"End mill on collet under {series['force_n']:g} N", "")
    canvas.save(figure, file)
