"""Modes of frequency responses and of impacts with many modes, each with its 95 % interval or why it is refused."""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
import numpy.typing as npt
from scipy import stats
from scipy.signal import find_peaks

from shapegcode.errors import RecordError
from shapegcode.identification import frf_search, model_search
from shapegcode.identification.checks import EXCITED, Prepared
from shapegcode.identification.frf_model import (
    Hits,
    Lines,
    ModalFit,
    correlation_of,
    hits_of,
    measured_lines,
    smoothed,
    steady_sines,
    weighted,
)
from shapegcode.identification.frf_search import Pole, StablePole, Uncertainty, Window, cut, fitted, starts_of
from shapegcode.identification.model_search import OPPOSED, Sought, chart_of, interval_refusal, mode_estimates
from shapegcode.identification.problem import MIN_CYCLES, Starts
from shapegcode.identification.result import ChartPole, Identification, IdentifiedMode, by_support
from shapegcode.io.record import ComplexArray, FrequencyResponse
from shapegcode.io.units import FloatArray

_BESIDE = 0.25  # also fit lines this far outside the requested band, relative to its ends
_COMMON = 0.5  # least common fraction of the bands of several responses
_FURTHER = 1.3  # fit lines up to this factor above the requested band, or the excited frequency
_SAME_POINT = 0.1  # largest relative difference of responses of one point
_MIN_WIDTH = 1.0  # least width of a resonance, in line spacings: narrower may be leakage
_HUM = 0.1  # a mode at a mains harmonic may be hum if it has not decayed to this ratio when the record ends
_MAINS_HZ, _HARMONICS, _HUM_WIDTH = (50.0, 60.0), 20, 1.5  # distance to a harmonic, in lines
_MAINS_WIDTH_HZ = 2.0
_VERY_CLEAR = 6.0  # added evidence needed by a mode unless it has both a peak of its own and a stable pole
_LOCAL, _LOCAL_WIDTHS = 30.0, 2.0  # % residual; range in half-power widths
_ACCEPTED_PERCENT = 50.0  # largest accepted half interval of the damping ratio
_MAX_MODES = 40  # default largest number of modes of a structure
_BEYOND = "beyond the requested number of modes: its peak is lower"
_DIFFERENT = 0.5  # residual ratio of one impact after the model of all: another point, axis or sign
POOR = 0.3  # largest residual ratio in the band of a usable model


@dataclass(frozen=True, eq=False)
class _Measured:
    parts: tuple[Lines, ...]
    low: float  # rad/s
    high: float
    record_s: float | None  # length of a record; None: lines only
    resolution_hz: float
    hits: Hits | None = None
    excitation: FloatArray | None = None  # (n,) force spectrum at the lines of impacts, maximum 1


@dataclass(frozen=True, eq=False)
class FrfModes:
    """Modes found in frequency lines, and the model of each response."""

    modes: tuple[IdentifiedMode, ...]  # refused ones too
    windows: tuple[Window, ...]
    chart: tuple[ChartPole, ...]
    model: tuple[ComplexArray, ...]  # (n,) lines of each response; as measured outside all windows
    fit_percent: float
    missing_peak_hz: float | None  # highest peak of the mobility, if no supported mode explains it
    different: str = ""  # source of an impact that the model of all impacts does not explain
    steady: bool = False  # a steady oscillation was removed from the records


def find_frf_modes(responses: Sequence[FrequencyResponse], files: tuple[str, ...], sought: Sought) -> Identification:
    """Find the modes that frequency responses of one structure support; see `identify.identify`."""
    used, one_point = _chosen(responses, sought.band_hz)
    merged = _merged(used) if one_point else used
    notes = list(dict.fromkeys(note for each in responses for note in each.notes))
    if len(used) > 1:
        said = f"are of several points: modes are fitted to all, masses are those at {used[0].source}"
        notes.append(f"{len(used)} frequency responses {'agree and are averaged: one point' if one_point else said}")
    if sought.exponential_window_s is None and sought.phase_known:
        notes.append(
            "a frequency response does not show overload, double hits or windows: an exponential window adds its "
            "damping, unless --exponential-window states it"
        )
    found = _in_responses(merged, sought)
    # Reverse the sign if the modes opposite to the force have higher peaks in total than the supported ones.
    with_it, against = (sum(_height(m) for m in found.modes if m.refusal == each) for each in ("", OPPOSED))
    turned = [f"{responses[0].source}: {model_search.TURNED}"] if against > with_it else []
    if turned:
        merged, used = ([replace(each, response=-each.response) for each in part] for part in (merged, used))
        found = _in_responses(merged, sought)
    modes = found.modes
    if not responses[0].scaled:
        modes = tuple(replace(m, mass_kg=None, damping_n_s_per_m=None, stiffness_n_per_m=None) for m in modes)
    lines = [found.model[0]] * len(used) if one_point and len(used) > 1 else list(found.model)
    left = np.concatenate([each.response - model for each, model in zip(used, lines, strict=True)])
    return Identification(
        files=files,
        **by_support(modes),
        order=len(frf_search.modes_of(found.windows)),
        fit_percent=found.fit_percent if found.modes else 0.0,
        noise_rms=float(np.sqrt(np.mean(np.abs(left) ** 2))),
        doubt=doubt_of(found),
        warnings=(*dict.fromkeys(warning for each in responses for warning in each.warnings), *turned),
        notes=tuple(notes),
        responses=tuple(used),
        turned=bool(turned),
        chart=found.chart,
        fitted_lines=tuple(lines),
    )


def _height(mode: IdentifiedMode) -> float:
    """Height of the peak of the mobility, up to a constant factor."""
    assert mode.mass_kg is not None
    return 1.0 / (mode.damping_ratio.value * mode.frequency_hz.value * mode.mass_kg.value)


def _chosen(
    responses: Sequence[FrequencyResponse], band_hz: tuple[float, float] | None
) -> tuple[list[FrequencyResponse], bool]:
    """Responses with the lines to fit, and whether several are of one point."""
    first = responses[0]
    for other in responses[1:]:
        for name in ("quantity", "axis", "scaled"):
            if getattr(first, name) != getattr(other, name):
                raise RecordError(
                    f"{first.source}: {name} is {getattr(first, name)}; {other.source}: {getattr(other, name)}: "
                    "must be the same in all files"
                )
    used = [_of_lines(each, each.response != 0.0) for each in responses]  # what is exactly 0 was not measured
    if band_hz is not None:
        lowest, highest = (float(end(each.frequency_hz[i] for each in responses)) for end, i in ((min, 0), (max, -1)))
        if not (band_hz[0] < band_hz[1] and band_hz[0] < highest and band_hz[1] > lowest):
            raise RecordError(
                f"band of {band_hz[0]:g} to {band_hz[1]:g} Hz: must ascend and overlap the lines, {lowest:g} to "
                f"{highest:g} Hz"
            )
        used = [within(each, (1.0 - _BESIDE) * band_hz[0], (1.0 + _BESIDE) * band_hz[1]) for each in used]
    first_hz, last_hz = np.array([each.frequency_hz[[0, -1]] for each in used]).T
    common, whole = last_hz.min() - first_hz.max(), last_hz.max() - first_hz.min()
    if common < _COMMON * whole:
        raise RecordError(
            f"{used[0].source} and {len(used) - 1} more share {max(common, 0.0):.4g} Hz of {whole:.4g} Hz: "
            "identify responses of different bands separately"
        )
    used = [within(each, first_hz.max(), last_hz.min()) for each in used]
    if len(used) < 2 or not all(np.array_equal(each.frequency_hz, used[0].frequency_hz) for each in used[1:]):
        return used, False
    mean = np.mean([each.response for each in used], axis=0)
    most = _SAME_POINT * float(np.linalg.norm(mean))
    return used, all(float(np.linalg.norm(each.response - mean)) < most for each in used)


def within(each: FrequencyResponse, low_hz: float, high_hz: float) -> FrequencyResponse:
    """Lines of a response between two frequencies."""
    return _of_lines(each, (each.frequency_hz >= low_hz) & (each.frequency_hz <= high_hz))


def _of_lines(each: FrequencyResponse, inside: npt.NDArray[np.bool_]) -> FrequencyResponse:
    if bool(np.all(inside)):
        return each
    coherence = None if each.coherence is None else each.coherence[inside]
    return replace(each, frequency_hz=each.frequency_hz[inside], response=each.response[inside], coherence=coherence)


def _merged(used: Sequence[FrequencyResponse]) -> list[FrequencyResponse]:
    """The mean of several responses of one point, with a coherence from their differences."""
    stacked = np.array([each.response for each in used])
    mean = np.mean(stacked, axis=0)
    scatter = np.sum(np.abs(stacked - mean) ** 2, axis=0) / (len(used) - 1) / len(used)
    power = np.abs(mean) ** 2
    return [replace(used[0], response=mean, coherence=np.clip(power / (power + scatter + 1e-300), 0.0, 1.0))]


def _of_hits(ready: Prepared, responses: Sequence[FloatArray], sought: Sought) -> tuple[_Measured, Hits]:
    """Spectral lines of the impacts, to be fitted; *responses*: those of the records, without steady oscillations."""
    period = ready.records[0].period_s
    duration = min(len(each) for each in responses) * period
    excited = min(max(each.excited_hz or 0.0 for each in ready.usable), 0.45 / period)
    low_hz, high_hz = MIN_CYCLES / duration, excited
    if sought.band_hz is not None:
        low_hz, high_hz = max(low_hz, sought.band_hz[0]), sought.band_hz[1]
    highest = min(_FURTHER * high_hz, 0.49 / period)
    hits = hits_of(ready.usable, responses, low_hz / (1.0 + _BESIDE), highest, sought.exponential_window_s)
    force = np.sqrt(np.sum(np.abs(hits.force) ** 2, axis=0))
    low, high = (2.0 * np.pi * each for each in (low_hz, min(1.1 * high_hz, 0.49 / period)))
    return _Measured((hits.lines,), low, high, duration, 1.0 / duration, hits, force / float(np.max(force))), hits


def find_hit_modes(ready: Prepared, sought: Sought) -> tuple[FrfModes, list[FloatArray]]:
    """Find modes in impacts, and the model's response for each record."""
    period = ready.records[0].period_s
    at_first = [steady_sines(each.record.response, period) for each in ready.usable]
    quiet = [each.record.response - sines for each, (sines, _) in zip(ready.usable, at_first, strict=True)]
    measured, hits = _of_hits(ready, quiet, sought)
    pool, poles = frf_search.candidates_of(measured.parts)
    windows = frf_search.search(measured.parts, measured.low, measured.high, pool, None)
    # Search for steady oscillations again in the residual of a first model.
    left = hits.in_time(_left(measured, hits, _model(measured.parts, windows)[0]))
    steady = [steady_sines(rest, period) for rest in left]
    if any(hertz for _, hertz in steady):
        for response, start, (sines, _) in zip(quiet, hits.starts, steady, strict=True):
            response[start : start + hits.count] -= sines
        measured, hits = _of_hits(ready, quiet, sought)
    first = frf_search.modes_of(windows)
    windows = frf_search.search(measured.parts, measured.low, measured.high, pool, first)
    found = _tested(measured, windows, pool, poles, sought)
    found = replace(found, steady=any(hertz for _, hertz in (*at_first, *steady)))
    rest = _left(measured, hits, found.model[0])
    inside = _inside(measured.parts[0], measured)
    courses = hits.in_time(np.where(inside, found.model[0] * hits.force, 0.0))
    fitted = [np.zeros(len(each)) for each in quiet]
    for samples, start, course in zip(fitted, hits.starts, courses, strict=True):
        samples[start : start + len(course)] = course
    shares = np.linalg.norm(rest, axis=1) / np.linalg.norm(np.where(inside, hits.response, 0.0), axis=1)
    worst = int(np.argmax(shares))
    if len(shares) > 1 and shares[worst] > _DIFFERENT:
        found = replace(found, different=ready.records[worst].source)
    return found, fitted


def _left(measured: _Measured, hits: Hits, model: ComplexArray) -> ComplexArray:
    """(impacts, n) responses to impacts minus those of a model; 0 outside the band."""
    return np.where(_inside(measured.parts[0], measured), hits.response - model * hits.force, 0.0)


def _in_responses(responses: Sequence[FrequencyResponse], sought: Sought) -> FrfModes:
    """Search for modes, search again with lines weighted by the first residual, and test every mode found."""
    parts = tuple(measured_lines(each, sought.exponential_window_s) for each in responses)
    low, high = min(float(each.omega[0]) for each in parts), max(float(each.omega[-1]) for each in parts)
    measured = _Measured(parts, low, high * (1.0 + 1e-9), None, max(each.resolution_hz for each in responses))
    pool, poles = frf_search.candidates_of(measured.parts)
    windows = frf_search.search(measured.parts, measured.low, measured.high, pool, None)
    models = _model(measured.parts, windows)
    parts = tuple(_weighed(lines, model) for lines, model in zip(measured.parts, models, strict=True))
    windows = frf_search.search(parts, measured.low, measured.high, pool, frf_search.modes_of(windows))
    for rank, window in enumerate(windows):
        correlation = correlation_of(window.fit.left)
        correlated = tuple(replace(lines, correlation=correlation) for lines in window.parts)
        windows[rank] = replace(window, parts=correlated)
    return _tested(replace(measured, parts=parts), windows, pool, poles, sought)


def _tested(
    measured: _Measured, windows: Sequence[Window], pool: Sequence[StablePole], poles: Sequence[Pole], sought: Sought
) -> FrfModes:
    """Modes of the windows in the searched band, each with its refusal, if any, and the quality of the fit."""
    modes = [mode for window in windows for mode in _modes(window, measured, pool, sought)]
    low_hz, high_hz = sought.band_hz or (0.0, np.inf)
    modes = _strongest([each for each in modes if low_hz <= each.frequency_hz.value <= high_hz], sought)
    model = _model(measured.parts, windows)
    parts = measured.parts
    left = [lines.weight * (lines.response - each) for lines, each in zip(parts, model, strict=True)]
    unexplained = _share_left(parts, left, [_inside(lines, measured) for lines in parts])
    by_order: dict[int, Starts] = {}
    for pole in poles:
        by_order.setdefault(pole.order, []).append((pole.omega, pole.zeta))
    return FrfModes(
        tuple(sorted(modes, key=lambda mode: mode.frequency_hz.value)), tuple(windows),
        chart_of(sorted(by_order.items())), tuple(model), 100.0 * (1.0 - unexplained), _missing_peak(measured, modes),
    )  # fmt: skip


def _strongest(modes: Sequence[IdentifiedMode], sought: Sought) -> list[IdentifiedMode]:
    """Keep the requested number of modes, those with the highest peaks; refused ones far below them are ignored."""
    supported = [mode for mode in modes if not mode.refusal and mode.mass_kg is not None]
    if sought.modes is not None and len(supported) < sought.modes:
        raise RecordError(f"{sought.modes} modes are asked for, and the data support no more than {len(supported)}")
    most = sought.modes or sought.max_modes or _MAX_MODES
    supported.sort(key=_height, reverse=True)
    over = {id(mode) for mode in supported[most:]}
    least = 0.02 * _height(supported[0]) if supported else 0.0
    return [
        replace(mode, refusal=_BEYOND, left_out=True)
        if id(mode) in over
        else replace(mode, left_out=mode.left_out or bool(mode.refusal and _height(mode) < least))
        for mode in modes
    ]


def _weighed(lines: Lines, model: ComplexArray) -> Lines:
    """Weight lines by the noise that fits the residual best: as assumed, as the model, or the mean of both."""
    left = np.abs(lines.response - model) ** 2
    # Lines without a mode nearby have no model: they keep their assumed noise.
    left = np.where(left > 0.0, left, np.log(2.0) / lines.weight**2)
    # The running mean may round to 0 or below next to far larger lines.
    even, high = (
        np.maximum(shape * smoothed(left / shape), 1e-300)
        for shape in (1.0 / lines.weight**2, np.abs(model) ** 2 + 1e-300)
    )
    noise = min((even, high, 0.5 * (even + high)), key=lambda each: float(np.sum(np.log(each) + left / each)))
    return weighted(lines, noise)


def _model(parts: Sequence[Lines], windows: Sequence[Window]) -> list[ComplexArray]:
    """Model of each response, from the windows; outside of them the response itself."""
    found = [lines.response.copy() for lines in parts]
    for window in windows:
        for row, (lines, left) in enumerate(zip(window.parts, window.fit.left, strict=True)):
            core = (lines.omega >= window.low) & (lines.omega < window.high)
            places = np.searchsorted(parts[row].omega, lines.omega[core])
            found[row][places] = parts[row].response[places] - left[core] / lines.weight[core]
    return found


def _inside(lines: Lines, measured: _Measured) -> npt.NDArray[np.bool_]:
    """Mask of the lines in which modes are searched."""
    return (lines.omega >= measured.low) & (lines.omega < measured.high)


def _share_left(parts: Sequence[Lines], left: Sequence[ComplexArray], inside: Sequence[npt.NDArray[np.bool_]]) -> float:
    """Weighted residual relative to the weighted response (RMS), over the lines `inside` of each response."""
    rest = sum(float(np.sum(np.abs(each[near]) ** 2)) for each, near in zip(left, inside, strict=True))
    pairs = zip(parts, inside, strict=True)
    total = sum(float(np.sum(np.abs((lines.weight * lines.response)[near]) ** 2)) for lines, near in pairs)
    return float(np.sqrt(rest / max(total, 1e-300)))


def _missing_peak(measured: _Measured, modes: Sequence[IdentifiedMode]) -> float | None:
    """Frequency of the highest peak of the mobility, Hz, if no supported mode explains it."""
    lines = measured.parts[0]
    height = np.abs(lines.response * lines.s ** (1 - lines.power))
    inside = _inside(lines, measured)
    if measured.excitation is not None:
        inside &= measured.excitation >= EXCITED
    inside &= lines.weight * np.abs(lines.response) > 5.0  # out of the noise
    if np.count_nonzero(inside) < 3:
        return None
    level = np.log(np.maximum(height[inside], 1e-300))
    tops, _ = find_peaks(level, prominence=np.log(2.0))  # twice their surroundings
    if not len(tops):
        return None
    top = float(lines.omega[inside][tops[int(np.argmax(level[tops]))]]) / (2.0 * np.pi)
    supported = [mode for mode in modes if mode.refusal in ("", _BEYOND)]
    widths = [mode.frequency_hz.value * (2.0 * mode.damping_ratio.value + 0.01) for mode in supported]
    there = any(abs(each.frequency_hz.value - top) < width for each, width in zip(supported, widths, strict=True))
    return None if there else top


def doubt_of(found: FrfModes) -> str:
    """Why the modes should not be used; empty: they may."""
    if found.different:
        return f"{found.different} responds differently from the other impacts: another point, axis or sign"
    if found.missing_peak_hz is not None:
        return f"the highest peak of the mobility, at {found.missing_peak_hz:.4g} Hz, belongs to no supported mode"
    if found.fit_percent < 100.0 * (1.0 - POOR):
        return f"the model explains only {found.fit_percent:.0f} % of the response in the band"
    return ""


def _modes(window: Window, measured: _Measured, pool: Sequence[StablePole], sought: Sought) -> list[IdentifiedMode]:
    if not window.inside():
        return []
    fit, known = window.fit, frf_search.uncertainty_of(window)
    others = _other_fits(window)
    found = []
    for index in window.inside():
        if fit.zeta[index] > 0.3:  # background, not a mode
            continue
        values, spread = _logarithms(window, known, index, measured, others)
        mode = mode_estimates(values, spread)
        dull = _excitation_refusal(mode.frequency_hz.value, measured)
        refusal = dull or _refusal(window, index, mode, measured, pool, sought)
        # A single high line can come from the start of a sweep or a joint between parts, not from a mode.
        width_hz = 2.0 * mode.damping_ratio.value * mode.frequency_hz.value
        spike = not sought.phase_known and width_hz < _MIN_WIDTH * measured.resolution_hz
        found.append(replace(mode, refusal=refusal, left_out=bool(dull) or (spike and bool(refusal))))
    return found


def _other_fits(window: Window) -> list[ModalFit]:
    """Fits of the same modes: one in a narrower band with another background, one as the other kind (real, complex)."""
    starts, kind = starts_of(window.fit), window.fit.complex_modes
    ends = (float(window.parts[0].omega[0]), float(window.parts[0].omega[-1]))
    narrow = [cut(lines, window.low / 1.15, window.high * 1.15, kind, 1) for lines in window.parts]
    other = [cut(lines, *ends, not kind) for lines in window.parts]
    found = []
    for parts in (narrow, other):
        columns = (2 + 1 + parts[0].complex_modes) * len(starts) + 6
        # Three independent samples per parameter, or more.
        enough = min(2 * len(lines.s) * lines.independent for lines in parts) > 3.0 * columns
        found += [fit] if enough and (fit := fitted(parts, starts)) is not None else []
    return found


def _logarithms(
    window: Window, known: Uncertainty, index: int, measured: _Measured, others: Sequence[ModalFit]
) -> tuple[FloatArray, FloatArray]:
    """Logarithms of frequency (Hz), damping ratio, mass, viscous damping and stiffness, and their 95 % half-widths."""
    fit = window.fit
    residue = abs(frf_search.residues_of(fit)[0, index])
    omega, zeta = starts_of(fit)[index]
    base = np.array([np.log(omega), np.log(zeta), np.log(max(residue, 1e-300))])
    scale = np.array([1.0, 1.0, 1.0 / max(residue, 1e-300)])
    covariance = _misfit(fit, window.parts, index) * known.each[0, index] * np.outer(scale, scale)
    change = model_search.LOGARITHMS
    values = change @ base + np.array([-np.log(2.0 * np.pi), 0.0, 0.0, np.log(2.0), 0.0])
    half = float(stats.t.ppf(0.975, known.freedom)) * np.sqrt(np.maximum(np.diag(change @ covariance @ change.T), 0.0))
    for other in others:
        size = abs(frf_search.residues_of(other)[0, index])
        moved = np.array([np.log(other.omega[index]), np.log(other.zeta[index]), np.log(max(size, 1e-300))]) - base
        half = np.hypot(half, np.abs(change @ moved))
    if measured.hits is not None:
        # Force noise rotates and scales the whole response near a mode.
        error = 2.0 * float(np.interp(omega, measured.parts[0].omega, measured.hits.gain_error))
        half = np.hypot(half, error * np.array([zeta, 1.0, 1.0, 1.0, 1.0]))
        half = np.maximum(half, _scatter(window, known, index, measured, scale))
    return values, half


def _misfit(fit: ModalFit, parts: Sequence[Lines], index: int) -> float:
    """Mean residual power of the fit around a mode, relative to that in the whole window; at least 1."""
    omega, width = float(fit.omega[index]), 2.0 * float(fit.zeta[index] * fit.omega[index])
    around, count = 0.0, 0
    for lines, left in zip(parts, fit.left, strict=True):
        near = lines.near(omega, width)
        around += float(np.sum(np.abs(left[near]) ** 2))
        count += int(np.count_nonzero(near))
    return max(1.0, around / max(count, 1) * sum(map(len, fit.left)) / max(fit.squares, 1e-300))


def _scatter(window: Window, known: Uncertainty, index: int, measured: _Measured, scale: FloatArray) -> FloatArray:
    """Half widths of the intervals from the scatter of a mode between impacts; 0 if noise explains it."""
    hits, fit, lines, change = measured.hits, window.fit, window.parts[0], model_search.LOGARITHMS
    assert hits is not None
    count = len(hits.force)
    if count < 2:
        return np.zeros(5)
    first = int(np.searchsorted(measured.parts[0].omega, lines.omega[0] - 1e-6))
    places = slice(first, first + len(lines.s))
    force, response = hits.force[:, places], hits.response[:, places]
    power = np.sum(np.abs(force) ** 2, axis=0)
    mean = measured.parts[0].response[places]
    rest = lines.weight * np.conj(force) * (response - mean * force) / power
    stacked = np.hstack((rest.real, rest.imag))
    begin = known.step.shape[0] - 2 * len(fit.omega) + 2 * index
    rows = known.step[[begin, begin + 1, index]]
    moved = (change * scale) @ (rows @ stacked.T)
    spread = np.sqrt(count / (count - 1.0) * np.sum((moved - moved.mean(axis=1, keepdims=True)) ** 2, axis=1))
    expected = np.sqrt(np.maximum(np.diag(change @ (known.each[0, index] * np.outer(scale, scale)) @ change.T), 1e-300))
    limit = np.sqrt(stats.chi2.ppf(1.0 - model_search.SCATTER_PROBABILITY, count - 1) / (count - 1))
    return np.asarray(np.where(spread > limit * expected, stats.t.ppf(0.975, count - 1) * spread, 0.0))


def _refusal(
    window: Window, index: int, mode: IdentifiedMode, measured: _Measured, pool: Sequence[StablePole], sought: Sought
) -> str:
    """Why the data do not support a mode; empty if they do."""
    omega, zeta = starts_of(window.fit)[index]
    hertz, width = omega / (2.0 * np.pi), 2.0 * zeta * omega
    return (
        _record_refusal(hertz, zeta, measured)
        or (_response_refusal(frf_search.residues_of(window.fit)[:, index]) if sought.phase_known else "")
        or _evidence_refusal(window, index, hertz, pool)
        or _local_refusal(window, omega, width)
        or interval_refusal(replace(mode, stiffness_n_per_m=None), sought.accepted_percent or _ACCEPTED_PERCENT)
    )


def _record_refusal(hertz: float, zeta: float, measured: _Measured) -> str:
    width = 2.0 * zeta * hertz
    if measured.record_s is None:
        if width >= _MIN_WIDTH * measured.resolution_hz:
            return ""
        return (
            f"its half-power width of {width:.3g} Hz is less than the {measured.resolution_hz:.3g} Hz between two "
            "lines: window and record length can cause such a peak; required: a finer resolution, or the time record"
        )
    refusal, lasting = model_search.lasting_refusal(hertz, zeta, measured.record_s)
    if refusal:
        return refusal
    mains = min((k * base for base in _MAINS_HZ for k in range(1, _HARMONICS)), key=lambda each: abs(each - hertz))
    if lasting > _HUM and abs(mains - hertz) < min(_HUM_WIDTH * measured.resolution_hz, _MAINS_WIDTH_HZ):
        return f"at {mains:g} Hz, a mains harmonic, and still at {100.0 * lasting:.0f} %: it may be hum"
    return ""


def _excitation_refusal(hertz: float, measured: _Measured) -> str:
    if measured.excitation is None:
        return ""
    excitation = float(np.interp(2.0 * np.pi * hertz, measured.parts[0].omega, measured.excitation))
    if excitation >= EXCITED:
        return ""
    return (
        f"the impact excites it only at {20.0 * np.log10(max(excitation, 1e-9)):.0f} dB of its largest force (limit "
        "-20 dB): take a harder tip"
    )


def _response_refusal(residues: ComplexArray) -> str:
    first = complex(residues[0])
    if len(residues) > 1:  # other points than that of the force may move in either direction
        return ""
    if first.real < 0.0:
        return OPPOSED
    if abs(first.imag) > first.real:
        return (
            f"its phase is {np.degrees(np.angle(first)):.0f}° from that of hammer and sensor at one point (limit 45°): "
            "another point, a delay between the channels, or no mode"
        )
    return ""


def _evidence_refusal(window: Window, index: int, hertz: float, pool: Sequence[StablePole]) -> str:
    """Refuse a mode unless the fit is worse without it; much worse, if the mode lacks an own peak or a stable pole."""
    fit = window.fit
    omega, zeta = starts_of(fit)[index]
    share = min(lines.independent for lines in window.parts)
    starts = [each for place, each in enumerate(starts_of(fit)) if place != index]
    apart = np.abs(fit.omega - omega) > zeta * omega + fit.zeta * fit.omega
    # Poles move only if one is within the width of the mode, in few iterations, so that it does not replace the mode.
    effort = (0, 1.0) if np.count_nonzero(~apart) == 1 else (10, 1e-4)
    without = fitted(window.parts, starts, effort)
    gain = np.inf if without is None else frf_search.evidence_of(without, share) - frf_search.evidence_of(fit, share)
    known = [each for each in pool if each.share >= frf_search.STABLE]
    stable = any(abs(each.omega - omega) < max(each.zeta, zeta) * omega for each in known)
    lines, left = window.parts[0], fit.left[0]
    modelled_lines = (lines.response - left / lines.weight) * lines.s ** (1 - lines.power)
    near = np.flatnonzero(lines.near(omega, zeta * omega, steps=1.0))  # half of its half-power width
    course = np.abs(modelled_lines.real)
    peak = any(0 < i < len(course) - 1 and course[i] >= course[i - 1] and course[i] > course[i + 1] for i in near)
    needed = 0.0 if peak and stable else _VERY_CLEAR
    if gain >= needed:
        return ""
    if peak and stable:
        return f"the fit without it is better (information criterion {gain:.1f}, limit 0)"
    return (
        f"no {'pole stable over model orders' if peak else 'peak of its own'} at {hertz:.4g} Hz, and the fit "
        f"without it is hardly worse (information criterion {gain:.1f}, limit {needed:g})"
    )


def _local_refusal(window: Window, omega: float, width: float) -> str:
    near = [lines.near(omega, _LOCAL_WIDTHS * width) for lines in window.parts]
    percent = 100.0 * _share_left(window.parts, window.fit.left, near)
    if percent <= _LOCAL:
        return ""
    return f"the model does not explain {percent:.0f} % of the response around it (limit {_LOCAL:g} %)"
