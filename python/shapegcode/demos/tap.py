"""Back, Ko and Kim, 2003 (paper 003) repeated: a body of 5 kg, an end mill, a collet, and both under a cutting force.

What the paper computes is computed here from the same numbers and printed beside it; where the two differ, the
difference stays and the reason is said.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass, field
from functools import partial
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import eigh

from shapegcode._core import (
    Arma,
    arma_decay,
    equivalent_mass_bisection,
    equivalent_mass_closed_form,
    poles_to_modes,
    wilson_theta,
)
from shapegcode.demos.result import Demonstration, Statement, stated
from shapegcode.demos.tap_figures import (
    Body,
    ColletFigures,
    EndMillFigures,
    SeriesFigures,
    SteppedFigures,
    SystemFigures,
)
from shapegcode.results.json import hidden

__all__ = ["TapDemo", "tap_demo"]

FloatArray = NDArray[np.float64]


SYSTEM = Body(5.0, 20.0, 4000.0)
"""Equation 10; the paper prints N·s/mm and N/mm."""
END_MILL = Body(0.9, 175.8, 5.07056987e7)
"""Equation 14."""
COLLET = Body(14.8, 158440.0, 1.06916679e9)
"""Equation 15; the list below it has a damping of 15844."""
_COLLET_DAMPING = 15844.0

_PERIOD_S, _SAMPLES = 0.005, 1024
_PAPER_THETA = 1.0  # not stated; the only value that gives the paper's phi
_TOLERANCE = 0.01
_RANGE_KG = (0.001, 1000.0)
_PAPER_PHI = (1.9605, -0.9803)
_PAPER_HZ, _PAPER_DAMPING = 4.5078, 0.0702
_MILL_PERIOD_S = 1.0 / 6000.0  # with it table 1's coefficients give table 1's frequency
_MILL_PHI = (0.6175, -0.9670)
_MILL_MODEL_PHI = (0.6192, -0.9676)
_MILL_RANGE_KG, _MILL_HALVINGS = (0.1, 100.0), 17
_MILL_SAMPLES = 2048
_MILL_FINER = 16
_MILL_THETA = 1.4  # the usual one
_CUTTING_FORCE_N = 100.0


@dataclass(frozen=True, repr=False, eq=False, kw_only=True)
class TapDemo(Demonstration):
    """Mass, damping and stiffness from a tap.

    Attributes:
        system: the body of 5 kg.
        end_mill: the end mill.
        collet: the collet.
        series: both under a force.
        acceleration: of the 5 kg body after 1 N·s, (n,), m/s².
        period_s: of its samples.
    """

    system: SystemFigures
    end_mill: EndMillFigures
    collet: ColletFigures
    series: SeriesFigures
    acceleration: FloatArray = field(metadata=hidden())
    period_s: float = field(metadata=hidden())

    @property
    def next_step(self) -> str:
        """The one thing to do next."""
        return "shapegcode identify --tap-plan"


def tap_demo(on_progress: Callable[[float], None] = lambda _: None) -> TapDemo:
    """The paper's simulation (section 3), its end mill and collet (section 5) and their deflection under 100 N.

    Args:
        on_progress: called with the share of the work done, 0 to 1.

    Source: Back, Ko and Kim, 2003 (paper 003).

    Returns:
        Each statement of the paper beside ours.
    """
    acceleration = _impulse_acceleration(SYSTEM, _PERIOD_S, _SAMPLES)
    system_rows, system = _system(acceleration)
    on_progress(0.5)
    mill_rows, mill = _end_mill()
    collet_rows, collet = _collet()
    series_rows, series = _series()
    return TapDemo(
        paper=TapDemo.cited("003"),
        title="Mass, damping and stiffness from a tap",
        rows=(*system_rows, *mill_rows, *collet_rows, *series_rows),
        remark=(
            "The paper's measured records are pictures, so its end mill is repeated from its printed coefficients and "
            "its collet from its equation. Its 'impulse of 1 N' is 1 N·s; its theta is not stated, and 1 gives its phi "
            "to the last digit. Its 4.5078 Hz lies within the rounding of its own phi; exact are 4.5016 Hz. "
            "Deflections are those of the printed stiffnesses."
        ),
        system=system,
        end_mill=mill,
        collet=collet,
        series=series,
        acceleration=acceleration,
        period_s=_PERIOD_S,
    )


_three, _five = partial(stated, "section 3"), partial(stated, "section 5")


def _slip(what: str, published: str, ours: str, note: str) -> Statement:
    """A figure of section 5 that does not follow from the paper's own numbers."""
    return Statement("section 5", what, published, ours, "explained", note=f"slip of the paper: {note}")


def _impulse_acceleration(body: Body, period_s: float, samples: int) -> FloatArray:
    """Acceleration after an impulse of 1 N·s, in closed form: x = Im(exp(s t))/(m Im(s)) with the body's pole s."""
    omega, zeta = 2.0 * math.pi * body.frequency_hz, body.damping_ratio
    pole = complex(-zeta * omega, omega * math.sqrt(1.0 - zeta**2))
    return np.asarray(
        (pole**2 * np.exp(pole * period_s * np.arange(samples))).imag / (body.mass_kg * pole.imag), dtype=np.float64
    )


def _rms(values: FloatArray) -> float:
    return float(np.sqrt(np.mean(values**2)))


def _of_phi(phi: tuple[float, float], period_s: float) -> tuple[float, float]:
    """Frequency in Hz and damping ratio of printed coefficients: the roots of lambda² - phi1 lambda - phi2."""
    return _modes(np.roots([1.0, -phi[0], -phi[1]]), period_s)


def _modes(poles: Any, period_s: float) -> tuple[float, float]:
    omega, zeta = poles_to_modes(poles, period_s)
    return float(omega[0]) / (2.0 * math.pi), float(zeta[0])


def _half_unit_reach(phi: tuple[float, float], period_s: float) -> tuple[float, float]:
    """Lowest and highest frequency of coefficients that round to the printed ones (four decimals)."""
    half = 0.5e-4
    found = [_of_phi((phi[0] + a, phi[1] + b), period_s)[0] for a in (-half, half) for b in (-half, half)]
    return min(found), max(found)


def _system(acceleration: FloatArray) -> tuple[list[Statement], SystemFigures]:
    """Section 3: the body of 5 kg."""
    wilson = wilson_theta(
        SYSTEM.mass_kg, SYSTEM.damping_n_s_per_m, SYSTEM.stiffness_n_per_m, np.zeros(_SAMPLES), _PERIOD_S,
        theta=_PAPER_THETA, velocity_m_per_s=1.0 / SYSTEM.mass_kg,
    )[2]  # fmt: skip
    exact, stepped = arma_decay([acceleration], 1), arma_decay([wilson], 1)
    (exact_hz, exact_damping), (stepped_hz, stepped_damping) = (
        _modes(each.poles, _PERIOD_S) for each in (exact, stepped)
    )
    low_hz, high_hz = _half_unit_reach(_PAPER_PHI, _PERIOD_S)
    closed, halved, halvings = _system_mass(np.asarray(wilson), stepped_hz, stepped_damping)
    omega = 2.0 * math.pi * exact_hz
    rows = [
        _three("RMS of the acceleration after 1 N·s", "0.8928", f"{_rms(acceleration):.4f}",
            _agree(_rms(acceleration), 0.8928, 5e-5), f"by Wilson-theta, theta = 1, {_rms(np.asarray(wilson)):.4f}",
        ),
        *(
            _three(f"phi{n + 1}", f"{abs(printed):.4f}", f"{stepped.phi[n]:.4f}",
                _agree(stepped.phi[n], printed, 5e-5),
                f"exact {exact.phi[n]:.4f}" + ("" if printed > 0.0 else "; the paper leaves out the sign"),
            )
            for n, printed in enumerate(_PAPER_PHI)
        ),
        _three("theta1", "0.004", f"{_theta(exact):.4f}", _agree(_theta(exact), 0.004, 1e-3), "exact"),
        _three("natural frequency", "4.5078 Hz", f"{exact_hz:.4f} Hz", low_hz <= _PAPER_HZ <= high_hz,
            f"the rounding of phi allows {low_hz:.3f} ... {high_hz:.3f} Hz; by Wilson-theta {stepped_hz:.3f} Hz",
        ),
        _three("damping ratio", "0.0702", f"{exact_damping:.4f}", _agree(exact_damping, _PAPER_DAMPING, 6e-4),
            f"by Wilson-theta {stepped_damping:.4f}",
        ),
        _three("eq. 11: 2 zeta omega, omega²", "3.9766, 802.22",
            f"{2.0 * exact_damping * omega:.4f}, {omega**2:.2f}", None, "exact: 4, 800",
        ),
        _three("mass in closed form", "(none)", f"{closed:.4f} kg", _agree(closed / SYSTEM.mass_kg, 1.0, 2e-3),
            "one simulation instead of a search: RMS is proportional to 1/m",
        ),
        _three("mass by bisection, 1 % tolerance", "5.0059 kg", f"{halved:.4f} kg", _agree(halved, 5.0059, 5e-5),
            "a middle of the range: the tolerance, not the data, decides its last digits",
        ),
        _three("halvings of 0.001 ... 1000 kg", "12", str(halvings), halvings == 12,
        ),
    ]  # fmt: skip
    return rows, SystemFigures(
        phi=tuple(exact.phi.tolist()),
        theta1=_theta(exact),
        rms_m_per_s2=_rms(acceleration),
        frequency_hz=exact_hz,
        damping_ratio=exact_damping,
        wilson_theta=SteppedFigures(
            _PAPER_THETA, 1, stepped_hz, stepped_damping, tuple(stepped.phi.tolist()), _rms(np.asarray(wilson))
        ),
        closed_form_kg=closed,
        bisection_kg=halved,
        halvings=halvings,
    )


def _theta(model: Arma) -> float:
    return float(model.theta[0, 0])


def _agree(here: float, paper: float, within: float) -> bool:
    return bool(abs(here - paper) <= within)


def _system_mass(response: FloatArray, hertz: float, damping: float) -> tuple[float, float, int]:
    """The mass from the simulated record and its impulse, as in the paper: by Wilson-theta, by halving; how often."""
    tap = (np.zeros(_SAMPLES), response, _PERIOD_S, 2.0 * math.pi * hertz, damping)
    low, high = _RANGE_KG
    closed = equivalent_mass_closed_form(*tap, theta=_PAPER_THETA, impulse_n_s=1.0)
    halved = equivalent_mass_bisection(
        *tap, low_kg=low, high_kg=high, tolerance=_TOLERANCE, theta=_PAPER_THETA, impulse_n_s=1.0
    )
    return closed.mass_kg, halved.mass_kg, halved.halvings


def _end_mill() -> tuple[list[Statement], EndMillFigures]:
    """Section 5: the end mill, from its printed coefficients and its equation."""
    hertz, damping = _of_phi(_MILL_PHI, _MILL_PERIOD_S)
    model_hz, model_damping = _of_phi(_MILL_MODEL_PHI, _MILL_PERIOD_S)
    mass = _middle(*_MILL_RANGE_KG, END_MILL.stiffness_n_per_m / 5.6370064e7, _MILL_HALVINGS)
    omega = 2.0 * math.pi * hertz
    stepped = {finer: _stepped_end_mill(finer) for finer in (1, _MILL_FINER)}
    rows = [
        _five("end mill, table 1: frequency", "1195 Hz", f"{hertz:.1f} Hz", _agree(hertz, 1195.0, 0.5), "6 kHz"),
        _five("end mill, table 1: damping ratio", "0.013", f"{damping:.4f}", _agree(damping, 0.013, 5e-4)),
        _five("end mill, eq. 13: 2 zeta omega, omega²", "195.2, 5.637e7",
            f"{2.0 * damping * omega:.1f}, {omega**2:.4g}", _agree(omega**2 / 5.6370064e7, 1.0, 2e-3),
            "with its 0.013 for the damping: 195.2",
        ),
        _five("end mill: mass", "0.9 kg", f"{mass:.4f} kg", _agree(mass, 0.9, 5e-3),
            f"middle {_MILL_HALVINGS} of 0.1 ... 100 kg; the paper's k / omega² = 0.8995",
        ),
        _five("end mill, eq. 14: stiffness", "5.07e7 N/m", f"{mass * omega**2:.3g} N/m",
            _agree(mass * omega**2 / END_MILL.stiffness_n_per_m, 1.0, 5e-3), "printed as N/mm",
        ),
        _five("end mill, table 2: phi of the model", "1194 Hz, 0.013", f"{model_hz:.1f} Hz, {model_damping:.4f}",
            _agree(model_hz, 1194.0, 0.5),
        ),
        _five("end mill, table 2: Wilson-theta at the sampling of the test", "1194 Hz, 0.013",
            f"{stepped[1].frequency_hz:.0f} Hz, {stepped[1].damping_ratio:.3f}", None,
            f"1.25 rad per step is too coarse for it; {_MILL_FINER} steps per sample give "
            f"{stepped[_MILL_FINER].frequency_hz:.0f} Hz, {stepped[_MILL_FINER].damping_ratio:.3f}",
        ),
    ]  # fmt: skip
    return rows, EndMillFigures(hertz, damping, mass, mass * omega**2, tuple(stepped.values()))


def _middle(low: float, high: float, wanted: float, count: int) -> float:
    """The middle that a bisection towards a value tries as its `count`-th."""
    middle = 0.5 * (low + high)
    for _ in range(count - 1):
        low, high = (low, middle) if middle > wanted else (middle, high)
        middle = 0.5 * (low + high)
    return middle


def _stepped_end_mill(steps: int) -> SteppedFigures:
    """Frequency and damping of the end mill's response by Wilson-theta with some steps per sample."""
    period_s = _MILL_PERIOD_S / steps
    response = wilson_theta(
        END_MILL.mass_kg, END_MILL.damping_n_s_per_m, END_MILL.stiffness_n_per_m, np.zeros(_MILL_SAMPLES * steps),
        period_s, theta=_MILL_THETA, velocity_m_per_s=1.0,
    )[2]  # fmt: skip
    sampled = np.asarray(response[::steps])
    model = arma_decay([sampled], 1)
    return SteppedFigures(
        _MILL_THETA, steps, *_modes(model.poles, _MILL_PERIOD_S), tuple(model.phi.tolist()), _rms(sampled)
    )


def _collet() -> tuple[list[Statement], ColletFigures]:
    """Section 5: the collet, of which only the equation is the collet's own."""
    listed = Body(COLLET.mass_kg, _COLLET_DAMPING, COLLET.stiffness_n_per_m)
    rows = [
        _slip(
            "collet, table 3: frequency", "1195 Hz", f"{COLLET.frequency_hz:.0f} Hz",
            "table 3 repeats table 1; here from eq. 15",
        ),
        _slip(
            "collet, table 3: damping ratio", "0.013", f"{COLLET.damping_ratio:.2f} or {listed.damping_ratio:.3f}",
            "c is 158440 in eq. 15 and 15844 below it",
        ),
    ]  # fmt: skip
    return rows, ColletFigures(COLLET.frequency_hz, COLLET.damping_ratio, listed.damping_ratio)


def _series() -> tuple[list[Statement], SeriesFigures]:
    """Both under 100 N: the force goes through the end mill into the collet, so their deflections add."""
    mill_um, collet_um = (1e6 * _CUTTING_FORCE_N / each.stiffness_n_per_m for each in (END_MILL, COLLET))
    slow_hz, fast_hz, dynamic_share = _chain()
    figures = SeriesFigures(_CUTTING_FORCE_N, mill_um, collet_um, (slow_hz, fast_hz), dynamic_share)
    share = figures.end_mill_share_percent
    rows = [
        _slip("end mill under 100 N", "18 µm", f"{mill_um:.2f} µm", "100 N on its own k = 5.07e7 N/m"),
        _slip("collet under 100 N", "0.7 µm", f"{collet_um:.3f} µm", "100 N on its own k = 1.07e9 N/m"),
        _five(
            "share of the end mill in the deflection", f"{100.0 * 18.0 / 18.7:.1f} % (18 of 18.7)",
            f"{share:.1f} %", share > 90.0, "most of it is the end mill's: so says the paper too",
        ),
        _five(
            "both as one chain: natural frequencies", "(none)", f"{slow_hz:.0f} Hz, {fast_hz:.0f} Hz",
            None, f"in the slower one the end mill makes {dynamic_share:.0f} % of the tip's deflection",
        ),
    ]  # fmt: skip
    return rows, figures


def _chain() -> tuple[float, float, float]:
    """Undamped modes of the end mill on the collet on the ground, and the end mill's share of the slower one."""
    mill, collet = END_MILL.stiffness_n_per_m, COLLET.stiffness_n_per_m
    squares, shapes = eigh(
        np.array([[mill, -mill], [-mill, mill + collet]]), np.diag([END_MILL.mass_kg, COLLET.mass_kg])
    )
    slow_hz, fast_hz = (math.sqrt(each) / (2.0 * math.pi) for each in squares)
    tip, nose = shapes[:, 0]
    return slow_hz, fast_hz, 100.0 * float((tip - nose) / tip)
