"""Identifies modes from files of tap tests, decays, sweeps or frequency responses: reads, checks and fits them."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import fields, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any, get_args

import numpy as np
from numpy.typing import ArrayLike
from scipy.signal import resample_poly
from threadpoolctl import threadpool_limits

from shapegcode import _core
from shapegcode.errors import ArgumentError, NumericError, RecordError
from shapegcode.identification import model_search
from shapegcode.identification.across import left_by, measured, with_moves
from shapegcode.identification.checks import Prepared, prepare
from shapegcode.identification.frf_fit import POOR, FrfModes, doubt_of, find_frf_modes, find_hit_modes
from shapegcode.identification.problem import HIGHEST_SHARE, Fit, FitProblem, are_pulses, problem_of
from shapegcode.identification.result import Identification, MassCheck, by_support
from shapegcode.identification.spectra import split_stops
from shapegcode.identification.sweep import find_modes_of_captures, find_swept_modes, is_capture
from shapegcode.io.data_file import open_file
from shapegcode.io.read import is_klipper, read_sweep
from shapegcode.io.record import FrequencyResponse, Quantity, ReadOptions, Record, UnevenTimeError, even_period
from shapegcode.io.units import FloatArray

if TYPE_CHECKING:
    from shapegcode.machine import Machine
    from shapegcode.program import Program

_LARGEST_MODEL = 99
_STRANGE = "a mode below 1 Hz, or with a mass above 100 t: are times in s, forces in N, and is the quantity right?"
_MIN_SAMPLES = 3
_FIRST_STOPS, _STOP_LEFT = 4, 0.1  # least number of stops fitted first; largest residual energy ratio of a used stop


def identify(
    source: str | Path | Record | FrequencyResponse | Sequence[str | Path | Record | FrequencyResponse] | ArrayLike,
    response: ArrayLike | ReadOptions | None = None,
    force: ArrayLike | None = None,
    *,
    options: ReadOptions | None = None,
    quantity: Quantity | None = None,
    max_modes: int | None = None,
    modes: int | None = None,
    band_hz: tuple[float, float] | None = None,
    start_s: float | None = None,
    stops: bool = False,
    accepted_percent: float | None = None,
    sweep: Program | str | Path | None = None,
    machine: Machine | str | Path | None = None,
    across: bool | str | Path | Record | FrequencyResponse | Sequence[str | Path | Record | FrequencyResponse] = False,
    strict: bool = True,
) -> Identification:
    """Identify modes from taps of one point (with force), free decays (without force), sweeps or frequency responses.

    Args:
        source: a file (CSV, UFF, WAV, MATLAB), a record, a frequency response, or several of one kind. All are
            of one axis and one point; only frequency responses may be of several points. With `response`: the instants
            of its samples in s, shape (n,), evenly spaced.
        response: what a sensor measured at these instants, shape (n,), in the unit of `quantity`. A `ReadOptions`
            here is taken as `options`.
        force: of the hammer at these instants in N, shape (n,); None: a free decay.
        options: information missing in the files.
        quantity: of `response`: "acceleration" in m/s² (None), "velocity" in m/s or "displacement" in m.
        max_modes: largest number of modes; None: 40 (frequency fit), 8 (time fit). A sweep without force: 4 at most.
        modes: number of modes; None: by information criterion.
        band_hz: lowest and highest frequency of interest; None: all (a sweep without force: 10 to 130 Hz).
        start_s: time at which a decay begins; None: found automatically.
        stops: the records are of an ordinary run: every stop after which the machine rests is a decay; the 20
            strongest of a record are used. Motion below 10 Hz, or the lower end of `band_hz`, is no vibration.
        accepted_percent: largest accepted half width of the 95 % interval of the damping ratio, in percent (in a time
            fit also of the stiffness); None: 5 % in a time fit, 50 % in a frequency fit. Not for a sweep without force.
        sweep: the program that ran during the record and moves one axis, as from `write_sweep`: its command takes the
            place of the force. The logger's start and clock error are found from the record.
        machine: the machine whose controller ran it.
        across: also find the mode shapes along the other axes. True: from other channels of the same files, which
            must state their axes (a triaxial sensor); else from these files or records of impacts at the same point.
        strict: raise if no record can be used; False: the reason is in the result's `reason`.

    Returns:
        The modes with their uncertainties, those that were refused and why, and how well they fit.

    Raises:
        ArgumentError: a number of modes outside 1 to 99; a sweep without its machine; options that cannot be combined.
        RecordError: no record can be used, or with `across` no response along another axis was found; the message
            says why and what is needed.
        MachineError, ProgramError: an invalid machine file, or program of a sweep.
        OSError: a file cannot be read.

    Source: Back, Ko and Kim, 2003 (paper 003 in docs/evidence/references.md) for its ARMA models; the fit in
    the time domain, intervals and refusals are this project's.
    """
    for name, number in (("max_modes", max_modes), ("modes", modes)):
        if number is not None and not 1 <= number <= _LARGEST_MODEL:
            raise ArgumentError(f"{name} = {number}: must be from 1 to {_LARGEST_MODEL}")
    if isinstance(response, ReadOptions):
        options, response = response, None
    options = options or ReadOptions()
    if quantity is not None and quantity not in (kinds := get_args(Quantity)):
        raise ArgumentError(f"quantity = {quantity!r}: must be one of {', '.join(kinds)}")
    if quantity is not None and response is None:
        raise ArgumentError("quantity is that of arrays: files, records and frequency responses state their own")
    if response is not None:
        source = [replace(_record_of(source, response, force, quantity or "acceleration"), axis=options.axis)]
    elif force is not None:
        raise ArgumentError("force is given without a response: identify(time_s, response, force)")
    is_one = isinstance(source, str | Path | Record | FrequencyResponse)
    sources: Sequence[Any] = [source] if is_one else source  # type: ignore[assignment]
    if hasattr(source, "columns"):
        raise ArgumentError("a table: identify(table[...].to_numpy(), ...) with its columns as arrays")
    if any(isinstance(each, float | int | np.ndarray | np.generic) for each in sources):
        raise ArgumentError("arrays: identify(time_s, response) or identify(time_s, response, force), each of (n,)")
    names = tuple(str(each) if isinstance(each, str | Path) else each.source for each in sources)
    window_s = options.exponential_window_s
    sought = model_search.Sought(band_hz, max_modes, modes, accepted_percent, window_s)
    if sweep is not None and (machine is None or response is not None):
        raise ArgumentError("a sweep needs the machine whose controller ran it, and files or records")
    if sweep is not None and not isinstance(across, bool):
        raise ArgumentError("across: a sweep needs one record of all axes, whose other channels are used")
    if sweep is not None and (stops or start_s is not None or options.ignore_force):
        raise ArgumentError("a sweep with its program has neither force, start of a decay nor stops: omit them")
    try:
        found = _identified(
            sources, names, options, sought, start_s, sweep, machine, stops=stops, across=across is not False,
            strict=strict,
        )  # fmt: skip
    except RecordError as error:
        if force is None:
            raise
        raise RecordError(f"{error}; the order of arrays is identify(time_s, response, force)") from None
    if any(mode.frequency_hz.value < 1.0 or (mode.mass_kg and mode.mass_kg.value > 1e5) for mode in found.modes):
        found = replace(found, warnings=(*found.warnings, _STRANGE))
    if across is False or sweep is not None or (not found.modes and found.reason):
        return found
    others: Any = [across] if isinstance(across, str | Path | Record | FrequencyResponse) else across
    files = sources if isinstance(across, bool) else others
    return with_moves(found, measured(files, replace(options, axis=None, response_columns=())), window_s)


def _identified(
    sources: Sequence[Any], names: tuple[str, ...], options: ReadOptions, sought: model_search.Sought,
    start_s: float | None, sweep: Program | str | Path | None, machine: Machine | str | Path | None, *, stops: bool,
    across: bool, strict: bool,
) -> Identification:  # fmt: skip
    """Find the modes along one axis; with `across`, for a known command, also their shapes along the others."""
    ready: Prepared | None = None
    band_hz = sought.band_hz
    try:
        # The matrices are small: several BLAS threads would wait for each other, up to twenty times as long.
        with threadpool_limits(limits=1, user_api="blas"):
            if sweep is not None and machine is not None:
                # Imported here: the simulation of a control is needed for no other record.
                from shapegcode.identification.known_command import find_modes_of_command, known_command

                return find_modes_of_command(known_command(sweep, machine), sources, options, sought, across=across)
            # If a response column is named, a capture is read as the record of a sensor.
            files = [] if options.response_columns else [Path(each) for each in sources if isinstance(each, str | Path)]
            if captures := [each for each in files if is_capture(each)]:
                _refuse_of_sensors(captures[0], options, start_s, stops=stops, across=across)
                if len(captures) < len(sources):
                    raise RecordError(f"{captures[0]}: a capture of command and encoder: identify others separately")
                return find_modes_of_captures(captures, options, sought)
            swept = _swept(sources, options)
            if swept is not None:
                _refuse_of_decays(f"{swept.source}: a sweep without force", start_s, stops=stops, across=across)
                return find_swept_modes(swept, names, sought)
            records, responses = _measured(sources, options)
            if responses:
                _refuse_of_decays(f"{responses[0].source}: a frequency response", start_s, stops=stops)
                return find_frf_modes(responses, names, sought)
            if stops:
                if start_s is not None:
                    raise ArgumentError(f"start at {start_s:g} s: is for one decay, --stops finds each start")
                return _modes_of_stops(records, names, sought)
            ready = prepare(records, band_hz=None if band_hz is None else band_hz[1], start_s=start_s)
            return _turned_if_opposed(ready, find_modes(ready, names, sought), sought)
    except (ArgumentError, NumericError) as error:
        if strict:
            raise
        reported: dict[str, Any] = {} if ready is None else {"warnings": ready.warnings, "notes": ready.notes}
        return Identification(files=names, prepared=ready, reason=str(error), **reported)


def _refuse_of_sensors(
    capture: Path, options: ReadOptions, start_s: float | None, *, stops: bool, across: bool
) -> None:
    """Refuse options for a sensor's record that would have no effect on a capture."""
    said = {each.name: getattr(options, each.name) != each.default for each in fields(options)} | {
        "start": start_s is not None, "stops": stops, "across": across, "axis": False,
    }  # fmt: skip
    for name, is_said in said.items():
        if is_said:
            option = {"period_s": "sample_period"}.get(name, name).removesuffix("_s").replace("_", "-")
            raise ArgumentError(
                f"{capture}: a capture of command and encoder, for which --{option} has no effect: it is for the "
                "record of a sensor (--response-column names one in a CSV)"
            )


def _refuse_of_decays(what: str, start_s: float | None, *, stops: bool, across: bool = False) -> None:
    for option, is_said in (("--stops", stops), ("--start", start_s is not None), ("--across", across)):
        if is_said:
            raise ArgumentError(f"{what}, for which {option} has no effect: it is for the record of a tap or decay")


def _turned_if_opposed(ready: Prepared, found: Identification, sought: model_search.Sought) -> Identification:
    """The modes found; if all are refused, some as opposite to the force: those of the reversed responses, if any."""
    if found.modes or not any(mode.refusal == model_search.OPPOSED for mode in found.refused):
        return found
    text = f"{ready.records[0].source}: {model_search.TURNED}"
    usable = tuple(
        replace(use, record=replace(use.record, response=-use.record.response), turned=not use.turned)
        for use in ready.usable
    )
    again = find_modes(replace(ready, usable=usable, warnings=(*ready.warnings, text)), found.files, sought)
    return again if again.modes else found


def _measured(sources: Sequence[Any], options: ReadOptions) -> tuple[list[Record], list[FrequencyResponse]]:
    found = measured(sources, options)
    records = [each for each in found if isinstance(each, Record)]
    responses = [each for each in found if isinstance(each, FrequencyResponse)]
    if responses and records:
        raise RecordError(
            f"{responses[0].source} is a frequency response, {records[0].source} a record over time: identify them "
            "apart"
        )
    return records, responses


def _modes_of_stops(records: Sequence[Record], files: tuple[str, ...], sought: model_search.Sought) -> Identification:
    """Find modes in the stillest third of the stops of all runs, 4 or more, then in all that these modes explain."""
    forced = [record for record in records if record.force_n is not None]
    if forced:
        raise ArgumentError(f"{forced[0].source}: contains a force: stops are searched in a run without a hammer")
    lowest_hz, highest_hz = sought.band_hz or (None, None)
    stops = split_stops(records, lowest_hz)
    if not stops:
        raise RecordError(
            f"{records[0].source}: no stop after which the machine rests for three cycles of the lowest "
            "mode (0.3 s at 10 Hz) and its vibration falls to a third; "
            "required: a run with pauses, such as dwells, or the decay after one stop"
        )
    ready = prepare(stops, band_hz=highest_hz)
    first = ready.usable[: max(_FIRST_STOPS, len(ready.usable) // 3)]
    found = find_modes(replace(ready, usable=first), files, sought)
    if not found.modes:
        return found
    moving = [use for use in ready.usable if left_by(found.modes, use.record) > _STOP_LEFT]
    if len(moving) == len(ready.usable):
        return found
    why = "the modes of the stillest stops do not explain it: something moved"
    return find_modes(ready.without(moving, why), files, sought)


def _record_of(time_s: Any, response: ArrayLike, force: ArrayLike | None, quantity: Quantity) -> Record:
    if np.iscomplexobj(response):
        raise RecordError("arrays: complex; of a frequency response: identify(sg.FrequencyResponse(...))")
    times = np.asarray(time_s, dtype=np.float64)
    samples = np.asarray(response, dtype=np.float64)
    if times.shape != samples.shape or times.ndim != 1 or len(times) < _MIN_SAMPLES:
        raise RecordError(
            f"arrays: {times.shape} instants and {samples.shape} samples of the response: one of each is needed, at "
            f"least {_MIN_SAMPLES}"
        )
    if not np.isfinite(times).all():
        raise RecordError(f"arrays: instant {np.flatnonzero(~np.isfinite(times))[0]} is not finite")
    try:
        period_s, warnings = even_period(times)
    except UnevenTimeError as error:
        raise RecordError(f"arrays: {error}; identify(time_s, response, force)") from None
    hammer = None if force is None else np.asarray(force, dtype=np.float64)
    start_s = float(times[0])
    return Record("arrays", period_s, samples, quantity, hammer, start_s=start_s, warnings=tuple(warnings))


def _swept(sources: Sequence[object], options: ReadOptions) -> Record | None:
    """The record of Klipper's resonance sweep; None if no file is one, or with `ignore_force`."""
    found = []
    for path in [Path(each) for each in sources if isinstance(each, str | Path)]:
        if path.is_file():
            with open_file(path) as file:
                found += [path] if is_klipper(file.read(400)) else []
    if not found or options.ignore_force:
        return None
    if len(sources) > 1:
        raise RecordError(f"{found[0]}: a sweep is identified alone: one file at a time")
    return read_sweep(found[0], options)


_FEW_MODES, _MORE, _START_DAMPING = 4, 2, 0.02  # largest number of modes for a fit over time; further modes tried
_SAMPLES_IN_TIME = 20_000  # largest number of samples, of all records, for a fit over time
_EXPLAINED, _NOISE_SHARE = 0.003, 1.5  # largest residual of few modes, relative to the record's RMS, or to its noise
_MANY = "many modes, or vibration that is no mode: fitted over frequency, band by band, within the excited band"
_SPECTRUM = 4096  # points of the force's transform
_FILTER_ERROR = 3e-4  # largest error of a mass by decimation: the filters attenuate by 80 dB
_FILTER_MOVES = (1e-6, 1e-4)  # ... of a frequency and of a damping ratio
_FINER = 16  # steps per sampling period of the check by Wilson's method
_POSSIBLY = 15.0  # allowed loss of evidence (twice the log odds) of another intersample behaviour of the force


def find_modes(ready: Prepared, files: tuple[str, ...], sought: model_search.Sought) -> Identification:
    """Find the modes supported by checked records of the same point; see `identify.identify`."""
    problem = problem_of(ready, sought.band_hz, within=sought.modes is not None)
    windowed = sought.exponential_window_s is not None
    if windowed and problem.forces is None:
        raise RecordError(
            "an exponential window of a free decay cannot be separated from its damping; with a force it can"
        )
    if problem.forces is not None and (windowed or (sought.modes is None and not are_pulses(ready))):
        # In the frequency domain all records are cut to the length of the shortest.
        longest = max(len(record.response) for record in ready.records)
        short = [each for each in ready.usable if 2 * len(each.record.response) < longest]
        long = ready.without(short, "shorter than half of the longest record")
        many, fitted = find_hit_modes(long, sought)
        few = None if windowed else _few(ready, problem, many, sought.band_hz is not None)
        if few is None:
            return _many(long, files, many, fitted)
        sought = replace(sought, max_modes=min(sought.max_modes or model_search.MAX_MODES, few + _MORE))
    models = model_search.search(problem, sought)
    sought.order(models)
    others: list[Fit] = []
    if problem.forces is not None and models.fits:
        problem, models, others = _choose_course(problem, models, sought)
    return _result(ready, files, problem, models, others, sought)


def _few(ready: Prepared, problem: FitProblem, many: FrfModes, narrow: bool) -> int | None:
    """Number of modes to expect in a fit over time; None: the fit over frequency, `many`, is to be used."""
    supported = [mode for mode in many.modes if not mode.refusal]
    starts = [(2.0 * np.pi * mode.frequency_hz.value, mode.damping_ratio.value) for mode in supported]
    power = np.mean([np.mean(record.response**2) for record in ready.records])
    noise = np.mean([(each.response_noise or 0.0) ** 2 for each in ready.usable]) / power
    limit = max(_EXPLAINED**2, _NOISE_SHARE**2 * noise)
    # A fit over time would take a steady oscillation for a mode.
    if many.steady or (problem.samples > _SAMPLES_IN_TIME and (starts or narrow)):
        return None
    quick: Fit | None = None
    while len(starts) <= _FEW_MODES:
        try:
            quick = problem.fit(starts, quick=True) if starts else None
        except (ArgumentError, NumericError):
            return None
        if quick is not None and quick.sum_of_squares < limit * problem.squares:
            return len(starts)
        peaks = problem.peaks_left(quick)
        if not peaks:
            return len(starts) if quick is None else None
        starts = [*(model_search.starts_of(quick) if quick is not None else []), (peaks[0], _START_DAMPING)]
    return None if supported else _FEW_MODES


def _many(ready: Prepared, files: tuple[str, ...], many: FrfModes, fitted: Sequence[FloatArray]) -> Identification:
    noise = [each.response_noise for each in ready.usable if each.response_noise is not None]
    return Identification(
        files=files,
        **by_support(many.modes),
        order=sum(len(window.inside()) for window in many.windows),
        fit_percent=many.fit_percent,
        noise_rms=float(np.sqrt(np.mean(np.square(noise)))) if noise else None,
        doubt=doubt_of(many),
        warnings=tuple(_warnings_of(ready)),
        notes=(*ready.notes, _MANY),
        prepared=ready,
        chart=many.chart,
        fitted=tuple(fitted),
        fitted_records=ready.records,
    )


def _warnings_of(ready: Prepared) -> list[str]:
    """Warnings of the records, including those not used."""
    return [*ready.warnings, *(f"{refused.source}: not used: {refused.reason}" for refused in ready.refused)]


def _choose_course(
    problem: FitProblem, models: model_search.Search, sought: model_search.Sought
) -> tuple[FitProblem, model_search.Search, list[Fit]]:
    """Choose the intersample behaviour of the force by evidence; also return fits with other possible behaviours."""
    courses = [(problem, models)]
    order = max(sought.order(models), 1)
    for other in problem.other_courses(models.fits[order - 1]):
        fits = tuple(other.fit(model_search.starts_of(fit)) for fit in models.fits[:order])
        evidence = tuple(model_search.evidence_of(other, fit) for fit in fits)
        # Search only where another behaviour may win: a wrong one needs extra modes.
        may_win = min(evidence) < min(models.evidence)
        courses.append((other, model_search.search(other, sought) if may_win else model_search.Search(fits, evidence)))
    best = min(courses, key=lambda course: min(course[1].evidence))
    least = min(best[1].evidence)
    starts = model_search.starts_of(best[1].fits[max(sought.order(best[1]), 1) - 1])
    # A record that begins within the pulse cannot show whether half of the impulse is missing.
    in_pulse = problem.starts_in_pulse and best[0].hold != "impulse"
    possible = [other for other, searched in courses if in_pulse or min(searched.evidence) < least + _POSSIBLY]
    others: list[Fit] = [other.fit(starts) for other in possible if other is not best[0]]
    return *best, others


def _result(
    ready: Prepared, files: tuple[str, ...], problem: FitProblem, models: model_search.Search, others: Sequence[Fit],
    sought: model_search.Sought,
) -> Identification:  # fmt: skip
    order = sought.order(models)
    warnings = _warnings_of(ready)
    squares = sum(float(np.sum(response**2)) for response in problem.responses)
    fitted_records, thinned = ready.records, problem.thinned
    if thinned is not None and problem.forces is not None:
        parts = zip(ready.records, problem.responses, problem.forces, thinned.first_s, strict=True)
        fitted_records = tuple(
            replace(each, response=response, force_n=force, period_s=thinned.period_s, start_s=each.start_s + first_s)
            for each, response, force, first_s in parts
        )
    without = Identification(
        files=files,
        evidence=dict(enumerate(models.evidence)),
        fit_percent=0.0,
        noise_rms=float(np.sqrt(squares / problem.samples)),
        reason="no mode exceeds the noise",
        warnings=tuple(warnings),
        notes=(*ready.notes, *_thinned_note(ready, problem, sought.band_hz)),
        prepared=ready,
        chart=model_search.chart_of(enumerate(model_search.chart_modes(problem), start=1)),
        fitted=tuple(np.zeros(len(response)) for response in problem.responses),
        fitted_records=fitted_records,
    )
    if order == 0:
        return without
    fit = models.fits[order - 1]
    of_white = 0.0 if thinned is None else thinned.noise_correlation
    coloured = abs(fit.residual_autocorrelation - of_white) * np.sqrt(fit.samples) > 4.0  # standard errors
    if coloured:
        fit = problem.fit(model_search.starts_of(fit), coloured=True)
        warnings.append(
            f"the model residual is not white noise (autocorrelation {fit.residual_autocorrelation:.2f}): the "
            "intervals allow for it; causes are other disturbances, or a nonlinear mode"
        )
    white_share = 1.0 / max(record.widened for record in ready.records) ** 2 if coloured else problem.white_share
    doubts = model_search.Doubts(
        limit_percent=sought.accepted_percent or model_search.ACCEPTED_PERCENT,
        band_hz=sought.band_hz or problem.band_hz,
        record_s=problem.duration_s,
        rival=model_search.rival_of(order, models.fits, problem.white_share),
        aliased=_aliased(ready, problem),
        white_share=white_share,
        least=(0.0, 0.0) if thinned is None else _FILTER_MOVES,
    )
    found = model_search.checked_modes(fit, _alone(problem, fit), others, doubts)
    left = float(np.sqrt(fit.sum_of_squares / squares)) if squares > 0.0 else 1.0
    return replace(
        without,
        **by_support(found),
        order=order,
        fit_percent=100.0 * (1.0 - left),
        noise_rms=float(np.sqrt(fit.sum_of_squares / (fit.samples - fit.parameters))),
        mass_check=_mass_check(problem, fit),
        doubt=f"the model explains only {100.0 * (1.0 - left):.0f} % of the response"
        if coloured and left > POOR
        else "",
        warnings=tuple(warnings),
        fitted=tuple(np.real(part) for part in fit.fitted),
    )


def _thinned_note(ready: Prepared, problem: FitProblem, band_hz: tuple[float, float] | None) -> list[str]:
    if problem.thinned is None:
        return []
    rates = f"{1.0 / ready.records[0].period_s:.6g} samples per second are decimated to {1.0 / problem.period_s:.6g}"
    if band_hz is not None:
        return [
            f"{rates}, enough for the band up to {band_hz[1]:g} Hz and response peaks above it, "
            "with one filter for force and response"
        ]
    return [
        f"{rates}, with one filter for force and response: above {problem.band_hz[1]:.4g} Hz the impact excites little "
        "and the response has no peak (--frequencies LOW:HIGH states another band)"
    ]


def _aliased(ready: Prepared, problem: FitProblem) -> Callable[[float], float]:
    """Fraction of the force's spectrum that may be aliased from above half the sampling rate, as a function of Hz."""
    is_simulated = problem.force_noise_n == 0.0 and problem.hold != "band_limited"
    record = ready.records[0]
    least = 0.0 if problem.thinned is None else _FILTER_ERROR
    if problem.hold == "impulse" or is_simulated or record.force_n is None:
        return lambda _hz: least
    pulse = np.trim_zeros(record.force_n)
    spectrum = np.abs(np.fft.rfft(pulse, _SPECTRUM))
    share = np.fft.rfftfreq(_SPECTRUM)
    highest = float(np.sqrt(np.mean(spectrum[share > HIGHEST_SHARE] ** 2)))
    noise = (ready.usable[0].force_noise_n or 0.0) * np.sqrt(len(pulse))
    # The spectrum of a half sine falls with the square of the frequency: two thirds of its end count as aliased.
    folded = 2.0 / 3.0 * np.sqrt(max(highest**2 - 2.0 * noise**2, 0.0))

    def at(frequency_hz: float) -> float:
        here = float(np.interp(frequency_hz * record.period_s, share, spectrum))
        return max(folded / here, least) if here > 0.0 else np.inf

    return at


def _alone(problem: FitProblem, fit: Fit) -> list[Fit]:
    """Fits of the same modes to each record alone; empty if there is a single record, or if one record lacks a mode."""
    count = len(problem.responses)
    try:
        return [problem.record(index).fit(model_search.starts_of(fit)) for index in range(count if count > 1 else 0)]
    except _core.ArgumentError:
        return []


def _mass_check(problem: FitProblem, fit: Fit) -> MassCheck | None:
    """The equivalent mass by paper 003's method, from the first impact, if the model has one mode."""
    if problem.forces is None or len(fit.omega_rad_s) != 1 or problem.hold == "impulse":
        return None
    signals = _finer(problem.forces[0], problem.held), _finer(problem.responses[0], "band_limited")
    args = *signals, problem.period_s / _FINER, float(fit.omega_rad_s[0]), float(fit.damping_ratio[0])
    closed = _core.equivalent_mass_closed_form(*args, quantity=problem.quantity)
    halved = _core.equivalent_mass_bisection(*args, quantity=problem.quantity)
    return MassCheck(closed.mass_kg, halved.mass_kg, halved.halvings)


def _finer(signal: FloatArray, hold: str) -> FloatArray:
    """Upsample a signal: straight between its samples, or band-limited."""
    if hold == "band_limited":
        return np.asarray(resample_poly(signal, _FINER, 1), dtype=np.float64)
    places = np.arange(len(signal) * _FINER) / _FINER
    return np.interp(places, np.arange(len(signal)), signal)
