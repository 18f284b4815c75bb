"""Exact linear plants beside SciPy's: `python tests/benchmarks/linear_plants.py`.

Ours and the peers run alternately on one core; beside the rates stands the largest difference between the results.
"""

from __future__ import annotations

import argparse
import json
from collections.abc import Callable
from typing import Any

import numpy as np
import numpy.typing as npt
from scipy import signal
from scipy.linalg import block_diag
from table import Sample, markdown, timed

import shapegcode as sg

Array = npt.NDArray[np.float64]

_MEGA = 1e6
_PERIOD_S = 1e-3
_MODES = [  # of X and of Y
    [sg.Mode(46.0, 0.02, 1.0), sg.Mode(210.0, 0.05, 0.3)],
    [sg.Mode(131.0, 0.02, 1.0), sg.Mode(340.0, 0.03, 0.2)],
]


def main() -> None:
    """Measure and print."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("--repetitions", type=int, default=9)
    parser.add_argument("--json", help="write every value to this file")
    arguments = parser.parse_args()
    rows = linear(arguments.repetitions)
    print(table(rows))
    if arguments.json:
        with open(arguments.json, "w", encoding="utf-8") as file:
            json.dump(rows, file, indent=1)


def table(rows: list[dict[str, Any]]) -> str:
    """Rows as Markdown: rates with least and largest value, the ratio of ours to each, the difference."""
    return markdown(
        ["plant", "million samples/s", "ours is times as fast", "largest difference, mm"],
        [
            [
                row["what"],
                str(Sample.of(row["rates"])),
                "" if row["ratios"] is None else str(Sample.of(row["ratios"])),
                "" if row["difference_mm"] is None else f"{row['difference_mm']:.1e}",
            ]
            for row in rows
        ],
    )


def linear(repetitions: int) -> list[dict[str, Any]]:
    """Two axes of two modes each under 200 000 set-points, exact for set-points that are linear in between.

    A sample is a row: both axes. `lsim`, slow as it is, gets a tenth of them. Results of SciPy's are command plus
    deflection, like ours; the design of its filters is not timed.
    """
    rows = 200_000
    steps = np.random.default_rng(1).normal(0.0, 0.05, (rows, 2))
    steps[0] = 0.0
    command = np.asfortranarray(np.cumsum(steps, axis=0))
    whole = [_filter_of(modes) for modes in _MODES]
    sections = [[_filter_of([mode]) for mode in modes] for modes in _MODES]
    systems = [_system_of(modes) for modes in _MODES]
    plant = sg.LinearPlant(*_joint(systems), _PERIOD_S)  # type: ignore[call-arg]
    few = rows // 10
    times = np.arange(few) * _PERIOD_S

    def filtered() -> list[Array]:
        return [signal.lfilter(*whole[a], command[:, a]) for a in range(2)]

    def by_modes() -> list[Array]:
        return [
            command[:, a] + sum(signal.lfilter(*section, command[:, a]) for section in sections[a]) for a in range(2)
        ]

    def simulated() -> list[Array]:
        return [signal.lsim(systems[a], command[:few, a], times)[1] for a in range(2)]

    return _beside(
        {
            "plant_response": (lambda: sg.plant_response(command, _MODES, _PERIOD_S).T, rows),
            "LinearPlant, 8 states": (lambda: plant.respond(command).T, rows),
            "lfilter, one transfer function per axis": (filtered, rows),
            "lfilter, one section per mode": (by_modes, rows),
            "lsim": (simulated, few),
        },
        repetitions,
    )


def _beside(runs: dict[str, tuple[Callable[[], Any], int]], repetitions: int) -> list[dict[str, Any]]:
    """Rates of all, alternating; the first is ours, with which the others, one array per axis, are compared."""
    results = {what: np.array(run()) for what, (run, _) in runs.items()}  # warm
    rates: dict[str, list[float]] = {what: [] for what in runs}
    for _ in range(repetitions):
        for what, (run, rows) in runs.items():
            rates[what].append(rows / timed(run)[0] / _MEGA)
    first = next(iter(runs))
    ours = results[first]
    return [
        {
            "what": what,
            "rates": rates[what],
            "ratios": None if what == first else (Sample.of(rates[first]) / Sample.of(rates[what])).values,
            "difference_mm": None if what == first else float(np.abs(ours[:, : result.shape[1]] - result).max()),
        }
        for what, result in results.items()
    ]


def _deflection_of(mode: sg.Mode) -> tuple[Array, Array]:
    """Numerator and denominator of deflection over command in continuous time."""
    omega = 2.0 * np.pi * mode.frequency_hz
    denominator = np.array([1.0, 2.0 * mode.damping_ratio * omega, omega**2])
    return np.array([-mode.participation, 0.0, 0.0]), denominator


def _filter_of(modes: list[sg.Mode]) -> tuple[Array, Array]:
    """Digital filter of one mode's deflection, or of the response of several, by first-order hold."""
    parts = [signal.cont2discrete(_deflection_of(mode), _PERIOD_S, method="foh")[:2] for mode in modes]
    if len(parts) == 1:
        return np.ravel(parts[0][0]), parts[0][1]
    numerator = denominator = np.array([1.0])  # of the command itself
    for own, factor in parts:
        numerator = np.convolve(numerator, factor) + np.convolve(np.ravel(own), denominator)
        denominator = np.convolve(denominator, factor)
    return numerator, denominator


def _system_of(modes: list[sg.Mode]) -> tuple[Array, Array, Array, Array]:
    """State space of an axis' response: per mode u = x + d and its rate without the damper's share of x'."""
    size = 2 * len(modes)
    a, b, c = np.zeros((size, size)), np.zeros((size, 1)), np.zeros((1, size))
    for k, mode in enumerate(modes):
        at, (_, (_, damping, square)) = 2 * k, _deflection_of(mode)
        a[at : at + 2, at : at + 2] = [[0.0, 1.0], [-square, -damping]]
        b[at : at + 2, 0] = [damping, square - damping**2]
        c[0, at] = mode.participation
    return a, b, c, np.array([[1.0 - sum(mode.participation for mode in modes)]])


def _joint(systems: list[tuple[Array, Array, Array, Array]]) -> list[Array]:
    """Both axes as one plant."""
    return [block_diag(*(system[k] for system in systems)) for k in range(4)]


if __name__ == "__main__":
    main()
