"""What is fitted: taps with force, or free decays, each as the core's fits want them."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
import numpy.typing as npt

from shapegcode import _core
from shapegcode.errors import RecordError
from shapegcode.identification.model_search import Fit, Starts
from shapegcode.identification.prepared import Prepared
from shapegcode.identification.support import LEAST_SWINGS
from shapegcode.identification.thinning import FLAT, Thinned, are_blows, highest_of_interest_hz, thin

FloatArray = npt.NDArray[np.float64]

#: Of the sampling rate: the force between samples is known up to there.
HIGHEST_SHARE = 0.45
_STEPS = 60  # of a fit
_QUICK_STEPS = 15  # of one that only shows where a mode may be


class _OverTime:
    """What records over time have in common, taps or decays."""

    responses: list[FloatArray]
    period_s: float
    band_hz: tuple[float, float]

    @property
    def samples(self) -> int:
        """Of all records together."""
        return sum(len(response) for response in self.responses)

    @property
    def constants(self) -> int:
        """Parameters of a model without modes: an offset per record."""
        return len(self.responses)

    @property
    def squares(self) -> float:
        """Sum over the responses, offsets taken out."""
        return sum(float(np.sum((response - response.mean()) ** 2)) for response in self.responses)

    @property
    def duration_s(self) -> float:
        """Of the longest record."""
        return max(len(response) for response in self.responses) * self.period_s

    @property
    def chart_orders(self) -> int:
        """Number of modes that the shortest record has samples for."""
        return (min(len(response) for response in self.responses) - 8) // 8

    def left(self, last: Fit | None) -> list[FloatArray]:
        """What a model leaves of the responses."""
        if last is None:
            return self.responses
        return [response - np.real(model) for response, model in zip(self.responses, last.fitted, strict=True)]

    def peaks_left(self, last: Fit | None, most: int) -> list[float]:
        """Frequencies (rad/s) of the highest peaks within the band of what a model leaves, the highest first."""
        residuals = self.left(last)
        length = 2 * max(len(residual) for residual in residuals)
        power = np.zeros(length // 2 + 1)
        for residual in residuals:
            power += np.abs(np.fft.rfft(residual - residual.mean(), length)) ** 2
        frequency = np.fft.rfftfreq(length, self.period_s)
        power[(frequency < self.band_hz[0]) | (frequency > self.band_hz[1])] = 0.0
        inner = np.flatnonzero((power[1:-1] >= power[:-2]) & (power[1:-1] > power[2:])) + 1
        highest = inner[np.argsort(power[inner])[::-1][:most]]
        return [float(2.0 * np.pi * frequency[index]) for index in highest]


@dataclass(frozen=True, eq=False)
class Taps(_OverTime):
    """Records with force."""

    forces: list[FloatArray]  # (n,) each, N
    responses: list[FloatArray]  # (n,) each, in the unit of the quantity
    period_s: float  # time between two samples
    band_hz: tuple[float, float]  # modes are looked for in it
    quantity: str  # what the sensor measured
    force_noise_n: float  # RMS of the force off the pulse
    hold: str  # course of the force between samples: "band_limited", "linear" or "impulse"
    thinned: Thinned | None = None  # what was thinned out before the fit; None: every sample is fitted
    begun: bool = False  # the record begins within the pulse
    widened: float = 1.0  # what intervals are multiplied with; see `Record`

    @property
    def white_share(self) -> float:
        """Share of white noise that reaches the samples: so many of them are independent."""
        return (1.0 if self.thinned is None else self.thinned.white_share) / self.widened**2

    @property
    def noise_correlation(self) -> float:
        """Between two samples on end, of noise that was white."""
        return 0.0 if self.thinned is None else self.thinned.noise_correlation

    @property
    def held(self) -> str:
        """Course of the force that is fitted: what was thinned out is band-limited, whatever it was."""
        return self.hold if self.thinned is None else "band_limited"

    def other_courses(self, near: Fit) -> list[Taps]:
        """The same taps with every other course that the force may take between its samples.

        An acceleration holds the force over the mass as it was at the samples, whatever its course between them. Where
        a straight course was thinned out, what the two differ by is taken away from the response.
        """
        if self.thinned is None:
            return [replace(self, hold="linear"), replace(self, hold="impulse")]
        if self.hold == "impulse":
            return []
        straight, responses = self.thinned.straight, self.responses
        if self.quantity == "acceleration" and isinstance(near, _core.ModalFit):
            free = float(np.sum(near.inverse_mass))
            parts = zip(responses, self.forces, straight, strict=True)
            responses = [response - free * (sampled - course) for response, sampled, course in parts]
        return [replace(self, forces=straight, responses=responses, hold="linear")]

    def fit(self, starts: Starts, coloured: bool = False) -> _core.ModalFit:
        """The best model near some modes, its residual white or coloured."""
        return self._fit(self.responses, starts, coloured, self.force_noise_n, _STEPS)

    def fit_quickly(self, starts: Starts) -> _core.ModalFit:
        """A model in a few steps."""
        return self._quick(starts, self.responses)

    def fit_left(self, starts: Starts, last: Fit | None) -> _core.ModalFit:
        """A model in a few steps of what another one leaves."""
        return self._quick(starts, self.left(last))

    def _quick(self, starts: Starts, responses: Sequence[FloatArray]) -> _core.ModalFit:
        return self._fit(responses, starts, False, 0.0, _QUICK_STEPS)

    def _fit(
        self, responses: Sequence[FloatArray], starts: Starts, coloured: bool, force_noise_n: float, steps: int
    ) -> _core.ModalFit:
        omega, zeta = np.array(starts).T
        return _core.fit_modes(
            self.forces,
            list(responses),
            self.period_s,
            omega,
            zeta,
            quantity=self.quantity,
            hold=self.held,
            # What is read after a blow lacks the force over the mass: so much of the force is fitted along.
            with_mass_line=self.hold == "impulse" and self.held != "impulse" and self.quantity == "acceleration",
            force_noise_n=force_noise_n,
            coloured_residuals=coloured,
            most_iterations=steps,
        )

    def poles(self, most: int) -> Sequence[npt.NDArray[np.complex128]]:
        """Discrete poles of models with 1 to `most` modes."""
        return _core.stabilisation_poles(self.responses, most, self.forces)

    def rank(self, candidates: Starts, kept: int) -> Sequence[int]:
        """Ranks of the candidates that explain most, beside those that are kept."""
        omega, zeta = np.array(candidates).T
        ranking = _core.rank_modes(
            self.responses, self.period_s, omega, zeta, kept + 1, self.forces, self.quantity, kept
        )
        return [int(index) for index in ranking.chosen]

    def record(self, index: int) -> Taps:
        """One record alone."""
        return replace(self, forces=[self.forces[index]], responses=[self.responses[index]])


@dataclass(frozen=True, eq=False)
class Decays(_OverTime):
    """Records without force."""

    responses: list[FloatArray]  # (n,) each
    period_s: float  # time between two samples
    band_hz: tuple[float, float]  # modes are looked for in it
    white_share: float = 1.0  # of the samples, how many are independent
    noise_correlation: float = 0.0  # none

    def fit(self, starts: Starts, coloured: bool = False) -> _core.DecayFit:
        """The best model near some modes, its residual white or coloured."""
        return self._fit(self.responses, starts, coloured, _STEPS)

    def fit_quickly(self, starts: Starts) -> _core.DecayFit:
        """A model in a few steps."""
        return self._quick(starts, self.responses)

    def fit_left(self, starts: Starts, last: Fit | None) -> _core.DecayFit:
        """A model in a few steps of what another one leaves."""
        return self._quick(starts, self.left(last))

    def _quick(self, starts: Starts, responses: Sequence[FloatArray]) -> _core.DecayFit:
        return self._fit(responses, starts, False, _QUICK_STEPS)

    def _fit(self, responses: Sequence[FloatArray], starts: Starts, coloured: bool, steps: int) -> _core.DecayFit:
        omega, zeta = np.array(starts).T
        return _core.fit_decay(
            list(responses), self.period_s, omega, zeta, coloured_residuals=coloured, most_iterations=steps
        )

    def poles(self, most: int) -> Sequence[npt.NDArray[np.complex128]]:
        """Discrete poles of models with 1 to `most` modes."""
        return _core.stabilisation_poles(self.responses, most)

    def rank(self, candidates: Starts, kept: int) -> Sequence[int]:
        """Ranks of the candidates that explain most, beside those that are kept."""
        omega, zeta = np.array(candidates).T
        ranking = _core.rank_modes(self.responses, self.period_s, omega, zeta, kept + 1, kept=kept)
        return [int(index) for index in ranking.chosen]

    def record(self, index: int) -> Decays:
        """One record alone."""
        return replace(self, responses=[self.responses[index]])


def problem_of(ready: Prepared, band_hz: tuple[float, float] | None, *, within: bool = False) -> Taps | Decays:
    """The records of a fit, and the band to look in.

    A strong mode outside the band asked for is part of what is measured within it: it is looked for too.
    """
    first = ready.records[0]
    responses = [record.response for record in ready.records]
    longest_s = max(len(response) for response in responses) * first.period_s
    if band_hz is not None and not 0.0 <= band_hz[0] < band_hz[1] <= 0.5 / first.period_s:
        raise RecordError(
            f"band of {band_hz[0]:g} to {band_hz[1]:g} Hz: must ascend and end below half the sampling rate, "
            f"{0.5 / first.period_s:g} Hz"
        )
    band = (LEAST_SWINGS / longest_s, HIGHEST_SHARE / first.period_s)
    if band_hz is not None:
        band = band_hz if within else (min(band[0], band_hz[0]), max(band[1], band_hz[1]))
    widest = max(record.widened for record in ready.records)
    if first.force_n is None:
        return Decays(responses, first.period_s, band, 1.0 / widest**2)
    forces = [record.force_n for record in ready.records if record.force_n is not None]
    noise = [value for value in ready.force_noise_n if value is not None]
    taps = Taps(
        forces,
        responses,
        first.period_s,
        band,
        first.quantity,
        float(np.sqrt(np.mean(np.square(noise)))) if noise else 0.0,
        "band_limited",
        begun=any(force[0] != 0.0 for force in forces),
        widened=widest,
    )
    thinned = thin(ready, highest_of_interest_hz(ready, None if band_hz is None else band_hz[1]))
    if thinned is None:
        return taps
    return replace(
        taps,
        forces=thinned.forces,
        responses=thinned.responses,
        period_s=thinned.period_s,
        band_hz=(band[0], min(band[1], FLAT / thinned.period_s)),
        force_noise_n=taps.force_noise_n * thinned.force_noise,
        thinned=thinned,
        hold="impulse" if are_blows(ready) else taps.hold,
    )
