"""A feed drive written down a second time, in plain Python and in other unknowns than the core's, for SciPy's solvers.

Unknowns in SI: position and speed of the motor, position and speed of the table, integral of the speed error,
deflection of the bristles, then deflection and its rate of each mode. Friction acts on the table (LuGre or smooth
Stribeck) and, viscous, on the motor.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any, Literal

import numpy as np
import numpy.typing as npt
from scipy.integrate import solve_ivp

from shapegcode import _core

Vector = npt.NDArray[np.float64]

_CONTACT_SHARE = 0.1  # docs/concepts/feed_drive.md: over this share of the gap the stiffness builds up


@dataclass
class Period:
    """Set-points between two instants: a straight line, and the speeds that the controller feeds forward."""

    begin_s: float
    setpoint_m: float
    velocity: float
    acceleration: float  # difference of the speeds over the period


class Drive:
    """Right side and Jacobian of one axis."""

    def __init__(self, parameters: _core.FeedDriveParameters, period_s: float) -> None:
        self.p = parameters
        self.period_s = period_s
        self.lugre = parameters.table_friction.model == _core.FrictionModel.lugre
        self.size = 6 + 2 * len(parameters.modes)
        self.now = Period(0.0, 0.0, 0.0, 0.0)
        self.scale = parameters.position_feedback == _core.PositionFeedback.table
        self.modes = [(2 * math.pi * m.frequency_hz, m.damping_ratio, m.participation) for m in parameters.modes]
        # Attributes of the binding are slow to read in an inner loop.
        self.motor_mass, self.table_mass = parameters.motor_mass_kg, parameters.table_mass_kg
        self.k, self.c = parameters.stiffness_n_per_m, parameters.damping_n_s_per_m
        self.kp, self.kv = parameters.position_gain_per_s, parameters.velocity_gain_n_s_per_m
        self.ki = self.kv / parameters.velocity_integral_time_s if parameters.velocity_integral_time_s else 0.0
        self.ff, self.af = parameters.velocity_feed_forward_ratio, parameters.acceleration_feed_forward_ratio
        self.gap, self.limit = parameters.backlash_m, parameters.force_limit_n
        self.motor_viscous = parameters.motor_friction.viscous_n_s_per_m
        f = parameters.table_friction
        self.viscous, self.fc, self.fs = f.viscous_n_s_per_m, f.coulomb_n, f.static_n
        self.vs, self.v0 = f.stribeck_velocity_m_per_s, f.smoothing_velocity_m_per_s
        self.s0, self.s1 = f.bristle_stiffness_n_per_m, f.bristle_damping_n_s_per_m
        self.stribeck = f.model == _core.FrictionModel.stribeck

    def spring(self, stretch: float) -> tuple[float, float]:
        """Elastic travel and share of contact."""
        if self.gap == 0.0:
            return stretch, 1.0
        rise = _CONTACT_SHARE * self.gap
        into = abs(stretch) - (self.gap - rise) / 2
        share = min(max(into / rise, 0.0), 1.0)
        travel = 0.0 if into <= 0 else (into * into / (2 * rise) if into < rise else into - rise / 2)
        return math.copysign(travel, stretch), share

    def friction(self, v: float, z: float) -> tuple[float, float]:
        """Force on the table and rate of the bristles."""
        force, rate = self.viscous * v, 0.0
        if self.lugre or self.stribeck:
            level = self.fc + (self.fs - self.fc) * math.exp(-((v / self.vs) ** 2))
            if self.stribeck:
                force += level * math.tanh(v / self.v0)
            else:
                rate = v - self.s0 * abs(v) / level * z
                force += self.s0 * z + self.s1 * rate
        return force, rate

    def rate(self, t: float, y: Sequence[float] | Vector) -> list[float]:
        """Derivatives of the unknowns."""
        xm, vm, xt, vt, q, z = map(float, y[:6])
        now = self.now
        setpoint = now.setpoint_m + now.velocity * (t - now.begin_s)
        speed_error = self.kp * (setpoint - (xt if self.scale else xm)) + self.ff * now.velocity - vm
        wanted = self.kv * speed_error + self.ki * q + self.af * (self.motor_mass + self.table_mass) * now.acceleration
        force = min(max(wanted, -self.limit), self.limit) if self.limit else wanted
        travel, share = self.spring(xm - xt)
        spring = self.k * travel + self.c * share * (vm - vt)
        friction, bristle = self.friction(vt, z)
        table = (spring - friction) / self.table_mass
        rates = [
            vm,
            (force - spring - self.motor_viscous * vm) / self.motor_mass,
            vt,
            table,
            speed_error + (force - wanted) / self.kv,
            bristle,
        ]
        for i, (omega, zeta, _) in enumerate(self.modes):
            d, v = float(y[6 + 2 * i]), float(y[7 + 2 * i])
            rates += [v, -omega * omega * d - 2 * zeta * omega * v - table]
        return rates

    def jacobian(self, t: float, y: Sequence[float] | Vector) -> Vector:
        """Matrix of the derivatives of `rate`, without force limit and backlash, LuGre friction."""
        vt, z = float(y[3]), float(y[5])
        excess = (self.fs - self.fc) * math.exp(-((vt / self.vs) ** 2))
        level = self.fc + excess
        relaxation = self.s0 * abs(vt) / level
        slope = -2 * excess * vt / self.vs**2
        rate_v = 1 - z * (self.s0 * math.copysign(1.0, vt) - relaxation * slope) / level
        friction_v = self.viscous + self.s1 * rate_v
        friction_z = self.s0 - self.s1 * relaxation
        m, mt = self.motor_mass, self.table_mass
        by_motor, by_table = (0.0, self.kp) if self.scale else (self.kp, 0.0)
        j = np.zeros((self.size, self.size))
        j[0, 1] = j[2, 3] = 1.0
        j[1, :5] = (
            (-self.kv * by_motor - self.k) / m,
            (-self.kv - self.c - self.motor_viscous) / m,
            (-self.kv * by_table + self.k) / m,
            self.c / m,
            self.ki / m,
        )
        j[3, :4] = (self.k / mt, self.c / mt, -self.k / mt, -(self.c + friction_v) / mt)
        j[3, 5] = -friction_z / mt
        j[4, 0], j[4, 1], j[4, 2] = -by_motor, -1.0, -by_table
        j[5, 3], j[5, 5] = rate_v, -relaxation
        for i, (omega, zeta, _) in enumerate(self.modes):
            row = 7 + 2 * i
            j[row - 1, row] = 1.0
            j[row] = -j[3]
            j[row, row - 1], j[row, row] = -omega * omega, -2 * zeta * omega
        return j

    def response_mm(self, y: Vector) -> float:
        """Table and modes."""
        return 1e3 * float(y[2] + sum(share * y[6 + 2 * i] for i, (_, _, share) in enumerate(self.modes)))


def periods(setpoints_mm: Vector, period_s: float) -> list[Period]:
    """The set-points as straight lines, from rest at zero."""
    points = np.concatenate([[0.0], setpoints_mm]) * 1e-3
    speeds = np.concatenate([[0.0], np.diff(points) / period_s])
    return [
        Period(i * period_s, points[i], speeds[i + 1], (speeds[i + 1] - speeds[i]) / period_s)
        for i in range(len(setpoints_mm))
    ]


def play(
    drive: Drive,
    setpoints_mm: Vector,
    *,
    method: Literal["Radau", "BDF"] = "Radau",
    rtol: float = 1e-9,
    atol_m: float = 1e-13,
    jac: Any = None,
) -> Vector:
    """Response, table, motor in mm and friction in N at each set-point: one call of solve_ivp for each period."""
    y = np.zeros(drive.size)
    atol = absolute_tolerances(drive, atol_m)
    rows = []
    for period in periods(setpoints_mm, drive.period_s):
        drive.now = period
        span = (period.begin_s, period.begin_s + drive.period_s)
        found = solve_ivp(drive.rate, span, y, method=method, jac=jac, rtol=rtol, atol=atol, t_eval=span[1:])
        assert found.success, found.message
        y = found.y[:, -1]
        rows.append([drive.response_mm(y), 1e3 * y[2], 1e3 * y[0], drive.friction(y[3], y[5])[0]])
    return np.array(rows)


def play_at_once(
    drives: Sequence[Drive], setpoints_mm: Sequence[Vector], *, rtol: float, atol_m: float
) -> list[Vector]:
    """Responses in mm of several axes in one call of solve_ivp (BDF) over the whole command, known beforehand.

    Nothing stops at the set-points: without feed-forward the right side has only kinks there.
    """
    period_s, count = drives[0].period_s, len(setpoints_mm[0])
    commands = [periods(setpoints, period_s) for setpoints in setpoints_mm]
    places = [slice(i * drives[0].size, (i + 1) * drives[0].size) for i in range(len(drives))]

    def look_up(t: float) -> None:
        for drive, command in zip(drives, commands, strict=True):
            drive.now = command[min(int(t / period_s), count - 1)]

    def rate(t: float, y: Vector) -> list[float]:
        look_up(t)
        values = y.tolist()
        return [slope for drive, at in zip(drives, places, strict=True) for slope in drive.rate(t, values[at])]

    def jacobian(t: float, y: Vector) -> Vector:
        look_up(t)
        matrix = np.zeros((len(y), len(y)))
        for drive, at in zip(drives, places, strict=True):
            matrix[at, at] = drive.jacobian(t, y[at])
        return matrix

    instants = np.arange(1, count + 1) * period_s
    atol = np.concatenate([absolute_tolerances(drive, atol_m) for drive in drives])
    found = solve_ivp(
        rate, (0.0, instants[-1]), np.zeros(len(atol)), method="BDF", jac=jacobian, rtol=rtol, atol=atol,
        t_eval=instants,
    )  # fmt: skip
    assert found.success, found.message
    return [np.array([drive.response_mm(y) for y in found.y[at].T]) for drive, at in zip(drives, places, strict=True)]


def absolute_tolerances(drive: Drive, atol_m: float) -> Vector:
    """As the core weighs them: lengths, speeds, bristles."""
    atol = np.full(drive.size, atol_m)
    atol[[1, 3]] *= 100.0
    atol[5] *= 0.01
    atol[7::2] *= 100.0
    return atol
