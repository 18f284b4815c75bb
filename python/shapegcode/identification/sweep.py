"""Modes from motion without a hammer: a resonance sweep, and a control's own capture."""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
from scipy.optimize import least_squares
from scipy.stats import t as student

from shapegcode.errors import RecordError
from shapegcode.identification.frf_fit import find_frf_modes
from shapegcode.identification.model_search import Sought, mode_estimates
from shapegcode.identification.result import Identification, IdentifiedMode, Sweep, as_sweep, by_support
from shapegcode.identification.servo.record import ServoTrace, read_servo_record
from shapegcode.identification.spectra import Spectra, moving_parts, transforms
from shapegcode.io.data_file import open_file
from shapegcode.io.edge_json import is_edge_json
from shapegcode.io.record import FEWEST_LINES, FrequencyResponse, ReadOptions, Record
from shapegcode.io.servo_log import is_servo_log
from shapegcode.io.units import FloatArray

SWEPT_HZ = (10.0, 130.0)  # Klipper's default sweep is 5 to 133 Hz; its ends are not a steady sweep
_BIN_HZ = 0.5  # averaging width of the spectrum, wider than the ripple from interfering harmonics
_BIN_NOISE = 0.05  # standard deviation of the logarithm of a bin's power
_MIN_S = 10.0
_APART_HZ = 8.0  # least distance of two tried peaks
_MAX_MODES = 4
_WIDENED = 2.0  # Factor on intervals for the command's spectrum, friction and backlash, which are not noise
_NO_VIBRATION = 0.5
_MIN_SHARE = 0.02  # least motion of a significant mode, relative to that of the axis


@dataclass(frozen=True, eq=False)
class _Model:
    """Model of the log power: level; slope beyond that of the command; relative weight, omega, zeta of each mode."""

    parameters: FloatArray
    covariance: FloatArray
    squares: float

    @property
    def starts(self) -> list[tuple[float, ...]]:
        return [tuple(row) for row in np.exp(self.parameters[2:].reshape(-1, 3))]

    def evidence(self, bins: int) -> float:
        """Bayesian information criterion; a bin's error is 5 % or more, since harmonics of the command interfere."""
        return float(bins * np.log(self.squares / bins + _BIN_NOISE**2) + len(self.parameters) * np.log(bins))


def find_swept_modes(record: Record, files: tuple[str, ...], sought: Sought) -> Identification:
    """Find the modes from a sweep of Klipper's resonance tester; see `identify.identify`."""
    band, modes = sought.band_hz or SWEPT_HZ, sought.modes
    frequency, power = _spectrum(record, band)
    fits = [_fit(frequency, power, [], free=False)]
    evidence = [fits[0].evidence(len(power))]
    while len(fits) - 1 < (modes or min(sought.max_modes or _MAX_MODES, _MAX_MODES)):
        fits.append(_next(frequency, power, fits[-1]))
        evidence.append(fits[-1].evidence(len(power)))
        if modes is None and len(fits) - 1 - int(np.argmin(evidence)) >= 1:
            break
    order = modes if modes is not None else int(np.argmin(evidence))
    best = fits[order]
    # Differences due to a free slope of the command's spectrum widen the intervals.
    other = _fit(frequency, power, best.starts, free=True)
    found = [_checked_mode(best, other, index, len(power)) for index in range(order)]
    found = [mode for mode in found if band[0] <= mode.frequency_hz.value <= band[1]]
    found.sort(key=lambda mode: mode.frequency_hz.value)
    fitted = np.exp(0.5 * _log_power(best.parameters, frequency))
    amplitude = np.sqrt(power)
    return Identification(
        files=files,
        **by_support(found),
        order=order,
        evidence=dict(enumerate(evidence)),
        fit_percent=100.0 * (1.0 - float(np.linalg.norm(fitted - amplitude) / np.linalg.norm(amplitude))),
        warnings=(
            *record.warnings,
            "a sweep without force gives no mass and no stiffness, and its command is assumed to grow linearly with "
            "frequency: intervals are wide; a mode near the ends of the band, or of another axis, may be missed",
        ),
        notes=(*record.notes, f"searched from {band[0]:g} to {band[1]:g} Hz (--frequencies LOW:HIGH)"),
        sweep=Sweep(record.source, record.axis, len(record.response), record.period_s, frequency, amplitude, fitted),
    )


def _spectrum(record: Record, band: tuple[float, float]) -> tuple[FloatArray, FloatArray]:
    """Centres of the frequency bins; mean power in each over the power of the command, which is proportional to f²."""
    duration = len(record.response) * record.period_s
    half = 0.5 / record.period_s
    if not 0.0 < band[0] < band[1] - 10.0 * _BIN_HZ:
        raise RecordError(f"band of {band[0]:g} to {band[1]:g} Hz: must ascend, by {10.0 * _BIN_HZ:g} Hz or more")
    if band[1] > 0.8 * half:
        raise RecordError(
            f"{record.source}: {1.0 / record.period_s:g} samples per second are too slow for {band[1]:g} Hz; required: "
            f"{2.5 * band[1]:.4g} or more, or another band (--frequencies)"
        )
    if duration < _MIN_S:
        raise RecordError(
            f"{record.source}: {duration:.3g} s: too short for a sweep ({_MIN_S:g} s or more); a decay after a "
            "stop is read with --decay"
        )
    if not np.ptp(record.response) > 0.0:
        raise RecordError(f"{record.source}: every sample is {record.response[0]:g}: is the sensor connected?")
    spectrum = np.abs(np.fft.rfft(record.response - record.response.mean())) ** 2 * record.period_s
    places = np.fft.rfftfreq(len(record.response), record.period_s)
    edges = np.arange(band[0], band[1] + 1e-9, _BIN_HZ)
    sums = np.histogram(places, edges, weights=spectrum / np.maximum(places, 1e-3) ** 2)[0]
    counts = np.histogram(places, edges)[0]
    return 0.5 * (edges[1:] + edges[:-1]), np.maximum(sums / np.maximum(counts, 1), 1e-300)


def _log_power(parameters: FloatArray, frequency: FloatArray) -> FloatArray:
    s = 2j * np.pi * frequency
    passed = np.ones(len(frequency), dtype=np.complex128)
    for share, omega, zeta in np.exp(parameters[2:].reshape(-1, 3)):
        passed -= share * s**2 / (s**2 + 2.0 * zeta * omega * s + omega**2)
    course = parameters[0] + parameters[1] * np.log(frequency)
    return np.asarray(course + np.log(np.maximum(np.abs(passed) ** 2, 1e-30)), dtype=np.float64)


def _fit(frequency: FloatArray, power: FloatArray, starts: list[tuple[float, ...]], *, free: bool) -> _Model:
    """Fit the logarithm of the power, robustly against a few outlying bins."""
    goal = np.log(power)
    first = np.concatenate(([float(np.median(goal)), 0.0], np.log(np.array(starts, dtype=np.float64)).ravel()))
    slope = 1.0 if free else 1e-9
    low = np.concatenate(([-np.inf, -slope], np.tile(np.log([1e-4, np.pi * frequency[0], 1e-3]), len(starts))))
    high = np.concatenate(([np.inf, slope], np.tile(np.log([3.0, 3.0 * np.pi * frequency[-1], 0.9]), len(starts))))

    def left(theta: FloatArray) -> FloatArray:
        return _log_power(theta, frequency) - goal

    begin = np.clip(first, low + 1e-12, high - 1e-12)
    found = least_squares(left, begin, bounds=(low, high), loss="soft_l1", f_scale=0.5)
    residual, squares = left(found.x), float(2.0 * found.cost)
    jacobian = np.asarray(found.jac, dtype=np.float64)
    freedom = max(len(goal) - len(first), 1)
    # Model errors are correlated between neighbouring bins.
    rho = float(np.clip(residual[1:] @ residual[:-1] / max(float(residual @ residual), 1e-300), 0.0, 0.95))
    covariance = np.linalg.pinv(jacobian.T @ jacobian) * squares / freedom * (1.0 + rho) / (1.0 - rho)
    return _Model(found.x, covariance, max(squares, 1e-300))


def _next(frequency: FloatArray, power: FloatArray, last: _Model) -> _Model:
    """The best model with one more mode, started at one of the two largest separate maxima of the last residual."""
    left = np.log(power) - _log_power(last.parameters, frequency)
    smooth = np.convolve(left, np.ones(5) / 5.0, "same")
    first = int(np.argmax(smooth))
    peaks = [first, int(np.argmax(smooth * (np.abs(frequency - frequency[first]) > _APART_HZ)))]
    tried = [
        _fit(frequency, power, [*last.starts, (share, 2.0 * np.pi * frequency[peak], zeta)], free=False)
        for peak in peaks
        for share in (0.1, 0.7)
        for zeta in (0.03, 0.1)
    ]
    return min(tried, key=lambda fit: fit.squares)


def _checked_mode(best: _Model, other: _Model, index: int, bins: int) -> IdentifiedMode:
    """One mode with its intervals, and its refusal, if any."""
    place = 2 + 3 * index
    quantile = _WIDENED * float(student.ppf(0.975, max(bins - len(best.parameters), 1)))
    halves = []
    for at, least in ((place + 1, 0.005), (place + 2, 0.1)):  # narrowest half intervals, relative
        apart = abs(float(other.parameters[at] - best.parameters[at]))
        halves.append(max(least, quantile * float(np.sqrt(max(best.covariance[at, at], 0.0))), apart))
    share, _, zeta = np.exp(best.parameters[place : place + 3])
    logarithms = best.parameters[place + 1 : place + 3] - np.array([np.log(2.0 * np.pi), 0.0])
    mode = mode_estimates(logarithms, np.array(halves))
    refusal = ""
    if share < _MIN_SHARE:
        refusal = f"{100.0 * share:.2g} % of the axis' motion (limit {100.0 * _MIN_SHARE:g} %)"
    elif zeta > _NO_VIBRATION:
        refusal = f"damping ratio {zeta:.2g}: no distinct vibration (limit {_NO_VIBRATION:g})"
    for name, estimate, limit in (
        ("frequency", mode.frequency_hz, 2.0),
        ("damping ratio", mode.damping_ratio, 30.0),
    ):
        if not refusal and not estimate.uncertainty_percent <= limit:
            refusal = (
                f"{name} is known only to {estimate.uncertainty_percent:.2g} % (limit {limit:g} % in a sweep): a "
                "slower sweep, more acceleration, or a tap"
            )
    return replace(mode, refusal=refusal)


_LOWEST_HZ, _OVER_HALF = 4.0, 2.5  # lowest line; samples per cycle of the highest line
_WINDOW_S = 8.0  # of a motion without rests
_AFTER_S = 1.0  # of the decay after each part, at most


def is_capture(path: Path) -> bool:
    """Whether a file may be a Sinumerik Edge capture (by its first bytes), or is a servo log."""
    with open_file(path) as file:
        head = file.read(4096)
    return is_edge_json(head) or is_servo_log(path, head)


def find_modes_of_captures(paths: Sequence[Path], options: ReadOptions, sought: Sought) -> Identification:
    """Find the modes of one axis in captures; see `identify.identify`."""
    traces, notes = [], []
    for path in paths:
        record = read_servo_record(path)
        traces.append((str(path), record.period_s, _axis_of(str(path), record.axes, options.axis)))
        notes += [f"{path}: {note}" for note in record.notes]
    responses = [_response(*each, sought.band_hz, options.axis) for each in traces]
    found = find_frf_modes(responses, tuple(map(str, paths)), replace(sought, phase_known=False))
    source, period_s, trace = traces[0]
    notes.append("modes are those with the encoder held, without masses")
    return as_sweep(found, notes, source, trace.samples, period_s, source, "capture of command and encoder")


def _axis_of(source: str, traces: Sequence[ServoTrace], axis: str | None) -> ServoTrace:
    """The trace of an axis, by its name, such as X, X1 or 1 (X1)."""
    linear = [each for each in traces if each.unit == "mm"]
    named = [each for each in linear if axis is not None and axis in each.name.lower()]
    if len(named) == 1 or (axis is not None and len(linear) == 1 and not set("xyz") & set(linear[0].name.lower())):
        return (named or linear)[0]
    names = ", ".join(f"{each.name}{'' if each in linear else ' (turns)'}" for each in traces)
    wanted = "add --axis x, y or z"
    if axis is not None:
        wanted = f"{'several are' if named else 'no linear one is'} called {axis.upper()}"
    raise RecordError(f"{source}: contains command and actual position of {names}: {wanted}")


def _response(
    source: str, period_s: float, trace: ServoTrace, band_hz: tuple[float, float] | None, axis: str | None
) -> FrequencyResponse:
    """Ratio −command/actual at the excited lines between the first and the last at which the parts agree."""
    windows = _windows(trace, period_s)
    if len(windows) < 2:
        raise RecordError(
            f"{source}: {trace.name} moves in {len(windows)} part{'' if len(windows) == 1 else 's'}; required: two "
            f"between rests of half a second, or more than {2 * _WINDOW_S:g} s of motion"
        )
    low, high = band_hz or (_LOWEST_HZ, np.inf)
    high = min(high, 1.0 / (_OVER_HALF * period_s))
    longest = (max(len(command) for command, _ in windows) + 2) * period_s
    hertz = np.arange(max(low, _LOWEST_HZ), high, 0.5 / longest)
    if len(hertz) < FEWEST_LINES:
        asked = "" if band_hz is None else f", the band asked for is {band_hz[0]:g} to {band_hz[1]:g} Hz"
        raise RecordError(
            f"{source}: a sample every {period_s * 1e3:g} ms resolves {_LOWEST_HZ:g} to "
            f"{1.0 / (_OVER_HALF * period_s):.4g} Hz{asked}"
        )
    none = np.zeros(len(windows))
    command, response = (transforms(list(parts), none, period_s, hertz) for parts in zip(*windows, strict=True))
    spectra = Spectra(hertz, command, response)
    used, coherence = spectra.coherent()
    if np.count_nonzero(used) < FEWEST_LINES:
        raise RecordError(
            f"{source}: the actual position of {trace.name} does not follow its command between {low:g} and "
            f"{high:.0f} Hz: too little motion, or positions too coarse; a sweep moves enough (shapegcode sweep)"
        )
    ratio = -1.0 / spectra.ratio()[used]
    return FrequencyResponse(source, hertz[used], ratio, "acceleration", coherence[used], axis, scaled=False)


def _windows(trace: ServoTrace, period_s: float) -> list[tuple[FloatArray, FloatArray]]:
    """Changes of speed, commanded and actual, of each part between rests; long parts are split into tapered windows."""
    found: list[tuple[FloatArray, FloatArray]] = []
    after, size = round(_AFTER_S / period_s), round(_WINDOW_S / period_s)
    for command, actual in zip(trace.command, trace.actual, strict=True):
        parts = moving_parts(command, period_s)
        followed = [*(first for first, _ in parts[1:]), len(command)][: len(parts)]
        for (begin, end), following in zip(parts, followed, strict=True):
            stop = min(following, end + after)
            ranges, taper = [slice(begin, stop)], np.ones(1)
            if end - begin > 2 * size:
                starts = range(begin, stop - size + 1, size // 2)
                ranges, taper = [slice(first, first + size) for first in starts], np.hanning(size)[1:-1]
            found += [(np.diff(command[each], 2) * taper, np.diff(actual[each], 2) * taper) for each in ranges]
    return found
