"""The feed drive behind a dead time, fitted to a record: what friction and speed loop explain beyond the servo lag.

A rigid axis of 1 kg stands for the drive: what it does depends on forces over mass alone, which is all that positions
can tell. Masses, lead and stiffness of the screw do not follow from them.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from shapegcode import _core
from shapegcode.characterization.servo.lag import LagFit, delayed

__all__ = ["DriveFit", "fit_drive"]

FloatArray = npt.NDArray[np.float64]
_RUN_UP_S = 0.4
_MM = 1e-3
_SMOOTHING_SHARE = 5e-4  # of the top speed, within which friction changes its sign
_STIFFNESS_N_PER_M, _DAMPING_N_S_PER_M = 4e6, 400.0  # of 1 kg: 640 Hz, far above the speed loop
# Dead time in ms; position gain, bandwidth in Hz, integral time, Coulomb friction as logarithms.
_LOW = (0.0, math.log(2.0), 0.0, math.log(5.0), math.log(1e-3), math.log(1e-7))
_HIGH = (30.0, math.log(500.0), 1.0, math.log(400.0), math.log(1.0), math.log(1e3))
_SCALE = (1.0, 0.3, 0.02, 0.5, 0.5, 1.0)
_STARTS = ((150.0, 0.02), (40.0, 0.005))  # bandwidth, integral time


@dataclass(frozen=True, eq=False)
class DriveFit:
    """A rigid feed drive with Coulomb friction behind a dead time.

    Attributes:
        dead_s: dead time.
        gain_per_s: position gain.
        rest: 1 − f, what the speed feed-forward leaves.
        bandwidth_hz: of the speed loop.
        integral_time_s: of the speed loop.
        coulomb: friction over mass, in mm/s² or degrees/s².
        offset: of the encoder against the command.
        error: of each stretch: command less actual position, as the model has it.
    """

    dead_s: float
    gain_per_s: float
    rest: float
    bandwidth_hz: float
    integral_time_s: float
    coulomb: float
    offset: float
    error: tuple[FloatArray, ...]


def fit_drive(
    commands: Sequence[FloatArray],
    actuals: Sequence[FloatArray],
    use: Sequence[npt.NDArray[np.bool_]],
    period_s: float,
    start: LagFit,
    tell: Callable[[], None] = lambda: None,
) -> DriveFit:
    """Fit the drive."""
    from scipy.optimize import least_squares

    problem = _DriveProblem(commands, actuals, use, period_s)
    lag_ms, gain = 1e3 * start.lag_s, min(max(start.gain_per_s, 15.0), 80.0)
    best: tuple[float, FloatArray] | None = None
    for bandwidth, integral in _STARTS:
        values = (
            max(lag_ms - 1.0, 0.1), math.log(gain), min(max(start.rest, 0.005), 0.5), math.log(bandwidth),
            math.log(integral), math.log(max(0.02 * problem.top_acceleration * _MM, 1e-6)),
        )  # fmt: skip
        found = least_squares(
            problem.residual, values, bounds=(_LOW, _HIGH), x_scale=_SCALE, diff_step=[1e-3] * len(values), max_nfev=20
        )
        if best is None or found.cost < best[0]:
            best = float(found.cost), np.asarray(found.x)
        tell()
    assert best is not None
    return problem.of(best[1])


@dataclass(frozen=True, eq=False)
class _DriveProblem:
    commands: Sequence[FloatArray]
    actuals: Sequence[FloatArray]
    use: Sequence[npt.NDArray[np.bool_]]
    period_s: float

    @property
    def top_speed(self) -> float:
        return max(float(np.abs(np.diff(way)).max()) for way in self.commands) / self.period_s

    @property
    def top_acceleration(self) -> float:
        return max(float(np.quantile(np.abs(np.diff(way, 2)), 0.99)) for way in self.commands) / self.period_s**2

    def _played(self, values: FloatArray) -> list[FloatArray]:
        """Position of the drive in each stretch; before it the axis has its first speed for long."""
        dead_ms, gain, rest, bandwidth, integral, coulomb = values
        friction = math.exp(coulomb)
        parameters = _core.FeedDriveParameters(
            motor_mass_kg=0.5,
            table_mass_kg=0.5,
            stiffness_n_per_m=_STIFFNESS_N_PER_M,
            damping_n_s_per_m=_DAMPING_N_S_PER_M,
            position_gain_per_s=math.exp(gain),
            velocity_gain_n_s_per_m=2.0 * math.pi * math.exp(bandwidth),
            velocity_integral_time_s=math.exp(integral),
            velocity_feed_forward_ratio=1.0 - rest,
            table_friction=_core.FrictionParameters(
                _core.FrictionModel.stribeck,
                coulomb_n=friction,
                static_n=friction,
                stribeck_velocity_m_per_s=_SMOOTHING_SHARE * self.top_speed * _MM,
                smoothing_velocity_m_per_s=_SMOOTHING_SHARE * self.top_speed * _MM,
            ),
        )
        out = []
        count = round(_RUN_UP_S / self.period_s)
        for way in self.commands:
            late = delayed(way, dead_ms * 1e-3 / self.period_s)
            run_up = late[0] + np.arange(-count, 0) * (late[1] - late[0])
            drive = _core.FeedDrive(parameters, self.period_s)
            drive.reset(run_up[0])
            out.append(np.asarray(drive.play(np.concatenate([run_up, late]))[count:, 0], dtype=np.float64))
        return out

    def residual(self, values: FloatArray) -> FloatArray:
        """Played less measured position, where it counts, over its scale."""
        played = self._played(values)
        left = np.concatenate([(y - x)[use] for y, x, use in zip(played, self.actuals, self.use, strict=True)])
        return np.asarray((left - left.mean()) * 1e3, dtype=np.float64)

    def of(self, values: FloatArray) -> DriveFit:
        """The drive of these values."""
        played = self._played(values)
        left = np.concatenate([(y - x)[use] for y, x, use in zip(played, self.actuals, self.use, strict=True)])
        offset = float(left.mean())
        dead_ms, gain, rest, bandwidth, integral, coulomb = (float(each) for each in values)
        return DriveFit(
            dead_s=dead_ms * 1e-3,
            gain_per_s=math.exp(gain),
            rest=rest,
            bandwidth_hz=math.exp(bandwidth),
            integral_time_s=math.exp(integral),
            coulomb=math.exp(coulomb) / _MM,
            offset=offset,
            error=tuple(way - y + offset for way, y in zip(self.commands, played, strict=True)),
        )
