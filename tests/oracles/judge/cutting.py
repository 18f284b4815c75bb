"""Forces of an end mill over one pitch or revolution: a stack of discs, summed up; shares no code with the core.

Law (paper 001, eq. 1-3): chip t = feed per tooth * cos(azimuth); dF_t = k1 t dz + K_te dz against the tooth's motion,
dF_r = k2 k1 t dz + K_re dz towards the axis; k1 and k2 power laws of the mean (or local) chip. Azimuth counts from the
feed to its left; the spindle turns clockwise seen from above; a right-hand helix lags upwards.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import cached_property

import numpy as np
import numpy.typing as npt

Array = npt.NDArray[np.float64]
Arcs = tuple[tuple[float, float, float, float], ...]

ANGLES = 240  # of a pitch
_DISC_RAD = 0.02  # by which a flute lags over one disc


@dataclass(frozen=True)
class EndMill:
    """Tool, law of the force (N, mm) and beam (mm, GPa), without runout."""

    diameter: float
    flutes: int
    helix_deg: float
    specific: float
    specific_exponent: float
    ratio: float
    ratio_exponent: float
    tangential_edge: float
    radial_edge: float
    local: bool
    rev_per_min: float
    overhang: float
    flute_length: float
    shank: float
    effective: float
    young_gpa: float
    holder_n_per_um: float = math.inf
    clockwise: bool = True

    @cached_property
    def tooth_s(self) -> float:
        """Time between two teeth."""
        return 60.0 / (self.flutes * self.rev_per_min)

    @cached_property
    def _tip_table(self) -> tuple[Array, Array]:
        height = np.linspace(0.0, self.flute_length, 200)
        return height, self.tip_um_per_n(height)

    def quick_tip_um_per_n(self, height: Array) -> Array:
        """The same from a table."""
        return np.interp(height, *self._tip_table)

    def tip_um_per_n(self, height: Array) -> Array:
        """Deflection of the tip under 1 N at heights above it: unit load, integral of M m / (E I), by sums."""
        z = np.linspace(0.0, self.overhang, 4001)
        z = 0.5 * (z[1:] + z[:-1])
        bent = np.where(z < self.flute_length, self.effective, self.shank)
        weight = z / (self.young_gpa * 1e3 * math.pi * bent**4 / 64.0) * (self.overhang / len(z))
        out = [float(np.sum(np.maximum(z - h, 0.0) * weight)) * 1e3 + 1.0 / self.holder_n_per_um for h in height]
        return np.array(out)


@dataclass(frozen=True)
class Figures:
    """Of one place at one feed."""

    mean_n: float
    peak_n: float
    torque_nm: float
    power_w: float
    deflection_um: float


class Cut:
    """One engagement: forces at any feed are sums of three parts with known powers of the feed."""

    def __init__(self, tool: EndMill, arcs: Arcs) -> None:
        self._tool = tool
        pitch = 2.0 * math.pi / tool.flutes
        turned = pitch * (np.arange(ANGLES) + 0.5) / ANGLES
        lag = math.tan(math.radians(tool.helix_deg)) / (0.5 * tool.diameter)
        area = sum((b - a) * (top - bottom) for a, b, bottom, top in arcs)
        chip = sum((math.sin(b) - math.sin(a)) * (top - bottom) for a, b, bottom, top in arcs)
        mean_cos = chip / area if area > 0.0 else 0.0
        e, e2 = tool.specific_exponent, tool.ratio_exponent
        self._parts: list[Array] = []  # (angles, 2) each: N at a feed per tooth of 1 mm
        self._tip: list[Array] = []
        self._torque: list[Array] = []
        total = [np.zeros((ANGLES, 2)) for _ in range(3)]
        tip = [np.zeros((ANGLES, 2)) for _ in range(3)]
        torque = [np.zeros(ANGLES) for _ in range(2)]
        for one, other, bottom, top in arcs:
            start, end = (one, other) if tool.clockwise else (-other, -one)
            discs = max(8, math.ceil(lag * (top - bottom) / _DISC_RAD))
            dz = (top - bottom) / discs
            z = bottom + dz * (np.arange(discs) + 0.5)
            compliance = tool.quick_tip_um_per_n(z)
            half = max(0.5 * lag * dz, 0.5 * pitch / ANGLES)  # nor finer than the steps of the spindle
            for flute in range(tool.flutes):
                azimuth = pitch * flute - turned[:, None] + lag * z[None, :]
                azimuth = np.remainder(azimuth + math.pi, 2.0 * math.pi) - math.pi
                low, high = np.maximum(azimuth - half, start), np.minimum(azimuth + half, end)
                width = np.maximum(high - low, 0.0) / (2.0 * half) * dz
                p = 0.5 * (low + high)
                cos = np.where(width > 0.0, np.maximum(np.cos(p), 0.0), 0.0)
                law = cos if tool.local else np.full_like(cos, mean_cos)
                law = np.where(law > 0.0, law, 1.0)
                k1 = tool.specific * law**e * cos * width
                k2 = k1 * tool.ratio * law**e2
                out = np.stack([np.cos(p), np.sin(p)], axis=-1)
                against = np.stack([-np.sin(p), np.cos(p)], axis=-1)  # a clockwise tooth moves towards smaller azimuth
                edge = (tool.tangential_edge * against - tool.radial_edge * out) * width[..., None]
                for i, force in enumerate((against * k1[..., None], -out * k2[..., None], edge)):
                    total[i] += force.sum(axis=1)
                    tip[i] += (force * compliance[None, :, None]).sum(axis=1)
                torque[0] += k1.sum(axis=1)
                torque[1] += tool.tangential_edge * width.sum(axis=1)
        self._total, self._bent, self._twist = total, tip, torque

    def figures(self, feed_mm_per_min: float) -> Figures:
        """At a feed in XY."""
        tool = self._tool
        ft = feed_mm_per_min / (tool.flutes * tool.rev_per_min)
        a = ft ** (1.0 + tool.specific_exponent) if ft > 0.0 else 0.0
        b = ft ** (1.0 + tool.specific_exponent + tool.ratio_exponent) if ft > 0.0 else 0.0
        edge = 1.0 if ft > 0.0 else 0.0
        force = np.hypot(*(a * self._total[0] + b * self._total[1] + edge * self._total[2]).T)
        bent = np.hypot(*(a * self._bent[0] + b * self._bent[1] + edge * self._bent[2]).T)
        torque = (a * self._twist[0] + edge * self._twist[1]) * 0.5 * tool.diameter * 1e-3
        return Figures(
            float(force.mean()), float(force.max()), float(torque.max()),
            float(torque.mean()) * 2.0 * math.pi * tool.rev_per_min / 60.0, float(bent.max()),
        )  # fmt: skip
