"""Mode shapes along the other axes: fits the known poles of modes to the responses along those axes.

With known poles the amplitudes follow linearly; the ratio of the amplitudes along two axes is the mode shape.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any, Self

import numpy as np
from scipy import stats

from shapegcode.errors import RecordError
from shapegcode.identification.checks import Prepared, Usable, is_clipped, prepare
from shapegcode.identification.frf_model import measured_lines, mode_columns
from shapegcode.identification.frf_search import cut
from shapegcode.identification.result import Estimate, Identification, IdentifiedMode
from shapegcode.identification.spectra import part_of
from shapegcode.io.read import read_measurement
from shapegcode.io.record import UNITS, ComplexArray, FrequencyResponse, ReadOptions, Record
from shapegcode.io.units import FloatArray
from shapegcode.results.outcome import Xyz

Measured = Record | FrequencyResponse
_AXES = "xyz"
_WIDTHS, _NEAREST = 8.0, 0.08  # fitted around a mode: half-power widths; ratio to its frequency
_LOCAL_WIDTHS, _LOCAL_LINES = 2.0, 4  # range around a mode for its residual
MIN_MOVE = 0.01  # relative to the motion along its own axis; smaller motion is not written, its phase not reported


@dataclass(frozen=True, eq=False)
class _Poles:
    omega: FloatArray  # (m,) rad/s
    zeta: FloatArray  # (m,)
    applied: float  # 1/s, decay rate added by an exponential window

    @classmethod
    def of(cls, modes: Sequence[IdentifiedMode], window_s: float | None = None) -> Self:
        omega = 2.0 * np.pi * np.array([mode.frequency_hz.value for mode in modes])
        zeta = np.array([mode.damping_ratio.value for mode in modes])
        return cls(omega, zeta, 0.0 if window_s is None else 1.0 / window_s)

    @property
    def in_plane(self) -> ComplexArray:
        """Poles of the responses, (m,) 1/s."""
        turn = 1j * np.sqrt(1.0 - self.zeta**2)
        return np.asarray(self.omega * (turn - self.zeta) - self.applied, dtype=np.complex128)


@dataclass(frozen=True, eq=False)
class _Amplitudes:
    """Amplitude of every mode along one axis, from one record or response."""

    value: ComplexArray  # (m,)
    variance: FloatArray  # (m,) of real and imaginary part together

    def turned(self, is_turned: bool) -> Self:
        """Amplitudes with the sign of the recorded signal, like those along the other axes."""
        return replace(self, value=-self.value) if is_turned else self


def measured(sources: Sequence[Any], options: ReadOptions) -> list[Measured]:
    """Records and frequency responses of all sources; reads those that are files."""
    found: list[Measured] = []
    for each in sources:
        found += [each] if isinstance(each, Record | FrequencyResponse) else read_measurement(each, options)
    return found


def with_moves(found: Identification, others: Sequence[Measured], window_s: float | None = None) -> Identification:
    """Add the mode shapes along other axes to an identification; `window_s`: exponential window of all records."""
    if found.axis is None:
        raise RecordError(f"{found.files[0]} does not say along which axis it was measured: add --axis x, y or z")
    others = [each for each in others if not _is_of_refused(each, found)]
    by_axis = {letter: [each for each in others if each.axis == letter] for letter in _AXES if letter != found.axis}
    if not any(by_axis.values()):
        raise RecordError(
            f"{', '.join(dict.fromkeys(each.source for each in others)) or found.files[0]}: no response along "
            f"{' or '.join(letter.upper() for letter in by_axis)}; required: a triaxial sensor, or files that "
            "state their axis"
        )
    if not found.modes:
        return found
    refused = [mode for mode in found.refused if 0.0 < mode.damping_ratio.value < 0.3]  # others are background
    own, along = _amplitudes(found, by_axis, _Poles.of((*found.modes, *refused), window_s))
    notes, modes = list(found.notes), []
    for index, mode in enumerate(found.modes):
        moves: dict[str, Estimate | None] = dict.fromkeys(_AXES) | {found.axis: Estimate(1.0, 1.0, 1.0)}
        for letter, parts in along.items():
            ratio, moves[letter] = in_phase = _ratio(own, parts, index)
            out_of_phase = abs(ratio.imag) > max(abs(ratio.real), MIN_MOVE)  # by more than 45°
            if out_of_phase and _is_significant(in_phase[1], abs(ratio)):
                notes.append(
                    f"{mode.frequency_hz.value:.4g} Hz: {letter.upper()} moves {abs(ratio):.3g} times as far, "
                    f"{abs(np.degrees(np.angle(ratio))):.0f}° out of phase: only the part in phase is used"
                )
        modes.append(replace(mode, moves=Xyz(moves["x"], moves["y"], moves["z"])))
    return replace(found, modes=tuple(modes), notes=tuple(notes))


def left_by(modes: Sequence[IdentifiedMode], record: Record) -> float:
    """Residual energy ratio of a free decay after a fit of known modes with free amplitudes."""
    values = record.response - np.mean(record.response)
    left = _decays(_Poles.of(modes), record.period_s, values)[2]
    return float(left @ left) / max(float(values @ values), 1e-300)


def significant_motions(mode: IdentifiedMode) -> dict[str, Estimate]:
    """The significant motions of a mode by axis, its own included: those whose interval does not include zero."""
    if mode.moves is None:
        return {}
    named = zip(_AXES, mode.moves, strict=True)
    return {letter: each for letter, each in named if each is not None and _is_significant(each, abs(each.value))}


def _is_significant(estimate: Estimate, size: float) -> bool:
    return size > 0.5 * (estimate.high - estimate.low)


def _amplitudes(
    found: Identification, by_axis: Mapping[str, Sequence[Measured]], poles: _Poles
) -> tuple[list[_Amplitudes], dict[str, list[_Amplitudes]]]:
    """Amplitudes of the modes along their own axis; the same along each of the other axes, by axis."""
    ready = found.prepared
    of_own: Measured = found.responses[0] if ready is None else ready.records[0]
    for each in (part for parts in by_axis.values() for part in parts):
        if each.quantity != of_own.quantity:
            raise RecordError(
                f"{each.source}: {each.quantity}, but {of_own.source}: {of_own.quantity}: must be the same along all "
                "axes"
            )
    if ready is None:
        own = [_in_lines(each, poles).turned(found.turned) for each in found.responses]
    else:
        own = [_in_time(use, use.record, poles).turned(use.turned) for use in ready.usable]
    along: dict[str, list[_Amplitudes]] = {}
    for letter, parts in by_axis.items():
        if ready is None:
            along[letter] = [_in_lines(each, poles) for each in parts if isinstance(each, FrequencyResponse)]
        else:
            beside = _records_beside(ready, [each for each in parts if isinstance(each, Record)], found.files)
            along[letter] = [_in_time(use, record, poles) for use, record in beside]
    for letter, amplitudes in along.items():
        if by_axis[letter] and not amplitudes:
            raise RecordError(
                f"{by_axis[letter][0].source} and {found.files[0]}: one is a frequency response, one a time record: "
                "both must be of the same kind"
            )
    return own, {letter: parts for letter, parts in along.items() if parts}


def _records_beside(
    ready: Prepared, records: Sequence[Record], files: Sequence[str]
) -> Sequence[tuple[Usable, Record]]:
    """Pair each impact or stop with the record of another axis."""
    if not records:
        return []
    together = all(any(_same_file(use, each, files) for use in ready.records) for each in records)
    if not together and ready.records[0].force_n is None:
        raise RecordError(
            f"{records[0].source}: amplitudes of separate free decays cannot be compared across axes: "
            "required: one record of all axes"
        )
    forceless = [] if together else [each for each in records if each.force_n is None]
    if forceless:
        raise RecordError(
            f"{forceless[0].source}: no force, but {ready.records[0].source} has one: amplitudes of different impacts "
            "are comparable relative to their forces only; required: the hammer's signal in both"
        )
    hits = ready if together else prepare(records)
    return [(use, _beside(use.record, records, files)) for use in hits.usable]


def _beside(use: Record, records: Sequence[Record], files: Sequence[str]) -> Record:
    """Cut from the records of another axis the part recorded at the same time as *use*."""

    def far(each: Record) -> tuple[bool, bool, float]:
        own = f"{use.source} ".startswith(f"{each.source} ")
        return not own, not _same_file(use, each, files), abs(each.start_s - use.start_s)

    first = min(records, key=far)
    begin = round((use.start_s - first.start_s) / first.period_s)
    if abs(first.period_s / use.period_s - 1.0) > 1e-6 or begin < 0 or begin + len(use.response) > len(first.response):
        raise RecordError(f"{first.source}: was not recorded together with {use.source}")
    beside = part_of(first, begin, begin + len(use.response))
    if not np.ptp(beside.response) > 0.0:
        raise RecordError(
            f"{beside.source}: every sample of the response is {beside.response[0]:g}: is the sensor connected?"
        )
    if is_clipped(beside.response):
        raise RecordError(
            f"{beside.source}: overload: the response ({beside.quantity}) is cut off at "
            f"{np.max(np.abs(beside.response)):.5g} {UNITS[beside.quantity]}; required: a larger range of the input or "
            "a softer impact"
        )
    return beside


def _is_of_refused(each: Measured, found: Identification) -> bool:
    """Whether a measurement is of a file whose impacts or stops were all refused."""
    own = any(f"{each.source} ".startswith(f"{name} ") for name in found.files)
    return own and isinstance(each, Record) and not any(_same_file(use, each, found.files) for use in found.taps)


def _same_file(use: Record, other: Record, files: Sequence[str]) -> bool:
    """True if both records are of one file: their sources begin with its name, followed by channel and impact."""
    return any(all(f"{each.source} ".startswith(f"{name} ") for each in (use, other)) for name in files)


def _in_time(use: Usable, record: Record, poles: _Poles) -> _Amplitudes:
    """Amplitudes at the first fitted sample; if the force is measured, divided by its transform at the poles."""
    first, period_s = 0, record.period_s
    if use.hit is not None:
        first = min(use.hit.end + (use.hit.end - use.hit.first) + _LOCAL_LINES, len(record.response) - 1)
    value, variance, left = _decays(poles, period_s, record.response[first:])
    omega = np.asarray(2.0 * np.pi * np.fft.rfftfreq(len(left), period_s), dtype=np.float64)
    variance = np.asarray(variance * _local(omega, np.abs(np.fft.rfft(left)) ** 2, poles))
    if use.record.force_n is None:
        return _Amplitudes(value, variance)
    force = use.record.force_n[:first]
    ago_s = period_s * (len(force) - np.arange(len(force)))
    gain = np.exp(ago_s[:, None] * poles.in_plane).T @ force * period_s
    return _Amplitudes(value / gain, variance / np.abs(gain) ** 2)


def _decays(poles: _Poles, period_s: float, values: FloatArray) -> tuple[ComplexArray, FloatArray, FloatArray]:
    """Fit mode amplitudes at the first sample and a straight line; returns amplitudes, variance and residual."""
    time_s = period_s * np.arange(len(values))
    waves = np.exp(time_s[:, None] * poles.in_plane)
    smooth = np.stack((np.ones(len(time_s)), np.linspace(-1.0, 1.0, len(time_s))), axis=1)
    return _solved(np.hstack((waves.real, -waves.imag, smooth)), values, len(poles.omega))


def _in_lines(each: FrequencyResponse, poles: _Poles) -> _Amplitudes:
    """Residues, each mode fitted to the lines around it."""
    omega, zeta = poles.omega, poles.zeta
    lines = measured_lines(each, 1.0 / poles.applied if poles.applied else None)
    value = np.zeros(len(omega), dtype=np.complex128)
    variance = np.full(len(omega), np.inf)
    for index, (at, damping) in enumerate(zip(omega, zeta, strict=True)):
        reach = max(_WIDTHS * damping, _NEAREST) * at
        part = cut(lines, at - reach, at + reach, complex_modes=True)
        near = np.abs(omega - at) <= reach
        count = int(np.count_nonzero(near))
        if 2 * len(part.s) < 2 * count + part.background.shape[1] + 8:
            continue
        column = mode_columns(part, omega[near], zeta[near])[0]
        turned = column * part.s[:, None] / omega[near]
        columns = np.hstack((part.weighted(column), part.weighted(turned), part.weighted_background))
        found, spread, left = _solved(columns, part.goal, count)
        half = len(left) // 2
        power = left[:half] ** 2 + left[half:] ** 2
        place = int(np.count_nonzero(near[:index]))
        value[index] = found[place]
        variance[index] = spread[place] * float(_local(part.omega, power, poles)[index])
    return _Amplitudes(value, variance)


def _solved(columns: FloatArray, goal: FloatArray, modes: int) -> tuple[ComplexArray, FloatArray, FloatArray]:
    """Least-squares factors of the modes (first columns: real parts, then imaginary), their variance, the residual."""
    norms = np.maximum(np.linalg.norm(columns, axis=0), 1e-300)
    basis, sizes, turned = np.linalg.svd(columns / norms, full_matrices=False)
    kept = sizes > 1e-10 * sizes[0]
    inverse = (turned[kept].T / sizes[kept]) @ basis[:, kept].T
    factors = inverse @ goal
    left = goal - (columns / norms) @ factors
    noise = float(left @ left) / max(len(goal) - int(np.count_nonzero(kept)), 1)
    spread = noise * np.einsum("ij,ij->i", inverse, inverse) / norms**2
    factors = factors / norms
    value = np.asarray(factors[:modes] + 1j * factors[modes : 2 * modes], dtype=np.complex128)
    return value, spread[:modes] + spread[modes : 2 * modes], left


def _local(at: FloatArray, power: FloatArray, poles: _Poles) -> FloatArray:
    """Residual power around each mode relative to the mean, at least 1."""
    omega, zeta = poles.omega, poles.zeta
    mean, step = max(float(np.mean(power)), 1e-300), float(at[1] - at[0])
    reach = np.maximum(_LOCAL_WIDTHS * zeta * omega, _LOCAL_LINES * step)
    near = np.abs(at - omega[:, None]) <= reach[:, None]
    around = near @ power / np.maximum(np.count_nonzero(near, axis=1), 1)
    return np.asarray(np.maximum(around / mean, 1.0), dtype=np.float64)


def _ratio(own: Sequence[_Amplitudes], other: Sequence[_Amplitudes], index: int) -> tuple[complex, Estimate]:
    """Ratio of a mode's amplitude along another axis to that along its own; its real part with the 95 % interval."""
    sides = [
        (np.array([part.value[index] for part in parts]), np.array([part.variance[index] for part in parts]))
        for parts in (own, other)
    ]
    if len(own) != len(other):  # else impact by impact: common changes cancel in the ratio
        sides = [(value.mean(keepdims=True), spread.sum(keepdims=True) / len(value) ** 2) for value, spread in sides]
    (one, one_variance), (two, two_variance) = sides
    weight = np.abs(one) ** 2
    ratio = complex(np.sum(np.conj(one) * two) / np.sum(weight))
    variance = float(np.sum(weight * (two_variance + abs(ratio) ** 2 * one_variance)) / np.sum(weight) ** 2)
    half = 1.96 * np.sqrt(0.5 * variance)
    if len(one) >= 5:  # fewer impacts do not determine their scatter
        scatter = np.sum((weight / np.sum(weight) * np.abs(two / one - ratio)) ** 2) * len(one) / (len(one) - 1)
        half = max(half, float(stats.t.ppf(0.975, len(one) - 1) * np.sqrt(0.5 * scatter)))
    return ratio, Estimate(ratio.real, ratio.real - half, ratio.real + half)
