"""The pictures of ``shapegcode identify``: records with fit, frequency response, stabilisation chart, decay."""

from collections.abc import Sequence
from dataclasses import replace
from functools import partial
from pathlib import Path

import numpy as np
from matplotlib.axes import Axes

from shapegcode.identification.result import Identification
from shapegcode.identification.spectra import decay_spectrum, frf, mode_envelopes
from shapegcode.io.record import UNITS, Record
from shapegcode.io.units import FloatArray
from shapegcode.results import plot
from shapegcode.results.outcome import Plot

_MAX_TRACES, _SEEN, _SHOWN_ABOVE = 3, 0.02, 2.5
_FILE_TIME = "time in the file in s"
_MIN_SHOWN = 1e-5  # of the largest value, on a logarithmic axis
_BELOW_NOISE = 0.3


def plots_of(found: Identification) -> dict[str, Plot]:
    """Pictures of an identification, by name."""
    if found.sweep is not None:
        drawn_by = {"identify-sweep": plot_sweep}
    elif found.responses:
        drawn_by = {"identify-response": plot_response, "identify-stabilisation": plot_stabilisation}
    else:
        drawn_by = {"identify-traces": plot_traces, "identify-stabilisation": plot_stabilisation}
        if found.modes:
            drawn_by["identify-decay"] = plot_decay
        drawn_by |= {"identify-spectrum": plot_spectrum} if found.decay else {"identify-response": plot_response}
    return {name: partial(draw, found) for name, draw in drawn_by.items()}


def plot_traces(found: Identification, ax: Axes | None = None) -> Axes:
    """Force and response over time, with the model's response, of at most three records.

    Args:
        found: the identification.
        ax: where to draw; None: a new figure.

    Returns:
        The first panel.
    """
    shown = list(zip(found.fitted_records, found.fitted, strict=True))[:_MAX_TRACES]
    rows = 1 if found.decay else 2
    many = f", {len(shown)} of {len(found.taps)} records" if len(found.taps) > len(shown) else ""
    panels = plot.grid(
        ax, rows, len(shown), size_inch=(4.0 + 3.6 * len(shown), 2.6 + 2.2 * rows), sharex="col",
        title=f"Records and model ({found.fit_percent:.1f} % fit{many})",
    )  # fmt: skip
    for column, (record, fitted) in zip(zip(*panels, strict=True), shown, strict=True):
        time_s = record.time_s if found.decay else record.time_s - record.start_s
        if record.force_n is not None:
            column[0].plot(time_s, record.force_n, color="black", linewidth=1.0)
            column[0].set_ylabel("force in N")
        panel = column[-1]
        _draw_both(panel, time_s, record.response, fitted)
        large = np.flatnonzero(np.abs(fitted - fitted[-1]) > _SEEN * np.abs(fitted).max())
        last = int(large[-1]) if len(large) else len(fitted) - 1
        xlabel = _FILE_TIME if found.decay else "time in s"
        panel.set(xlim=(time_s[0], time_s[last]), ylabel=_quantity(record), xlabel=xlabel)
        column[0].set_title(Path(record.source).name, fontsize=9, loc="right")
        plot.legend_above(panel)
    return panels[0][0]


def _draw_both(panel: Axes, x: FloatArray, measured: FloatArray, fitted: FloatArray) -> None:
    panel.plot(x, measured, color=plot.GREY, linewidth=2.2, label="measured")
    panel.plot(x[: len(fitted)], fitted, "--", color=plot.COLOURS[0], linewidth=1.1, label="model")


def plot_response(found: Identification, ax: Axes | None = None) -> Axes:
    """Frequency response, measured and of the model: magnitude, phase, coherence.

    Args:
        found: an identification from taps or from frequency responses.
        ax: where to draw; None: a new figure.

    Returns:
        The panel of the magnitude.
    """
    if found.responses:
        measured, name = found.responses[0], Path(found.responses[0].source).name
        model, title = replace(measured, response=found.fitted_lines[0], coherence=None), f"Frequency response: {name}"
    else:
        measured, model = frf(found.fitted_records), frf(_as_fitted(found))
        taps = len(found.taps)
        title = f"Frequency response, {taps} {'tap' if taps == 1 else 'taps averaged'}"
    seen = _seen(measured.frequency_hz, found)
    rows = 2 if measured.coherence is None else 3
    column = plot.column(ax, rows, size_inch=(9.0, 2.1 + 1.8 * rows), title=title)
    magnitude, phase = column[:2]
    magnitude.set_yscale("log")
    lines = [each.response[seen] for each in (measured, model)]
    _draw_both(magnitude, measured.frequency_hz[seen], *(np.abs(ratio) for ratio in lines))
    # From -90 to 270 degrees: the phase of an acceleration is 180 below a mode, where noise would wrap it.
    degrees = (90.0 + np.degrees(np.angle(-1j * ratio)) for ratio in lines)
    _draw_both(phase, measured.frequency_hz[seen], *degrees)
    if measured.coherence is not None:
        column[2].plot(measured.frequency_hz[seen], measured.coherence[seen], color=plot.COLOURS[1], linewidth=1.0)
        column[2].set(ylabel="coherence", ylim=(0.0, 1.05))
    phase.set(ylabel="phase in degrees", yticks=[-90, 0, 90, 180, 270])
    column[-1].set_xlabel("frequency in Hz")
    column[-1].margins(x=0.01)
    bottom, top = magnitude.get_ylim()
    magnitude.set(ylabel=f"({UNITS[measured.quantity]})/N", ylim=(bottom, 4.0 * top))  # room for the labels
    _mark_modes(column, found)
    plot.legend_above(magnitude)
    return magnitude


def plot_stabilisation(found: Identification, ax: Axes | None = None) -> Axes:
    """Poles by the order of the model over the spectrum, and the chosen order.

    Args:
        found: the identification.
        ax: where to draw; None: a new figure.

    Returns:
        The panel.
    """
    frequency, amplitude = _spectrum(found)
    seen = _seen(frequency, found)
    panel = plot.axes(ax, size_inch=(9.0, 5.5))
    # The legend is between the panel and the title.
    panel.set_title("Stabilisation chart: poles by the order of the model", loc="left", fontsize=11, pad=26)
    background = panel.twinx()
    background.semilogy(frequency[seen], amplitude[seen], color="#c8c8c8", linewidth=1.0)
    background.set_axis_off()
    panel.set_zorder(background.get_zorder() + 1)
    panel.patch.set_visible(False)
    kinds = (
        ("new", "x", plot.GREY, "none"),
        ("frequency within 1 %", "o", plot.COLOURS[1], "none"),
        ("and damping within 5 %", "o", plot.COLOURS[2], plot.COLOURS[2]),
    )
    highest = frequency[seen][-1]
    for stable, (label, marker, edge, face) in enumerate(kinds):
        poles = [
            pole
            for pole in found.chart
            if pole.stable_frequency + pole.stable_damping == stable and pole.frequency_hz <= highest
        ]
        panel.plot(
            [pole.frequency_hz for pole in poles], [pole.order for pole in poles], marker, linestyle="none",
            markeredgecolor=edge, markerfacecolor=face, label=label, alpha=1.0 if stable == 2 else 0.35,
        )  # fmt: skip
    panel.plot([], [], color="#c8c8c8", linewidth=1.0, label="spectrum")
    panel.axhline(found.order, color="black", linewidth=0.8, linestyle="--", label=f"chosen: {found.order}")
    panel.set(xlabel="frequency in Hz", ylabel="modes in the model", xlim=(frequency[seen][0], highest))
    panel.set_yticks(range(1, max((pole.order for pole in found.chart), default=1) + 1))
    plot.legend_above(panel, columns=5, columnspacing=1.2, handletextpad=0.4)
    return panel


def plot_decay(found: Identification, ax: Axes | None = None) -> Axes:
    """Envelope of the first record in the band of each mode (the first four at most), measured and of the model.

    The model's envelope is drawn down to three times the noise, which is the residual of the model in the band. Below
    that, it would show the ringing of the band-pass filter.

    Args:
        found: an identification with a mode or more.
        ax: where to draw; None: a new figure.

    Returns:
        The upper panel.
    """
    frequencies = [mode.frequency_hz.value for mode in found.modes][:4]
    record, model = found.fitted_records[0], _as_fitted(found)[0]
    begin = 0 if record.force_n is None else int(np.argmax(np.abs(record.force_n)))
    record, model = (replace(each, response=each.response[begin:], force_n=None) for each in (record, model))
    name = f": {Path(record.source).name}" if len(found.taps) > 1 else ""
    title = f"Decay: envelope of the {record.quantity} in the band of each mode{name}"
    column = plot.column(ax, len(frequencies), size_inch=(9.0, 1.4 + 2.0 * len(frequencies)), title=title)
    left = replace(record, response=record.response - model.response)
    bands = (mode_envelopes(each, frequencies) for each in (record, model, left))
    time_s = record.time_s if found.decay else record.time_s - record.time_s[0]
    longest = 1
    for panel, frequency, measured, fitted, rest in zip(column, frequencies, *bands, strict=True):
        top = float(measured.max())
        noise = max(float(np.median(rest)), _MIN_SHOWN * top)
        peak = int(np.argmax(fitted))
        below = np.flatnonzero(fitted[peak:] < 3.0 * noise)
        end = peak + int(below[0]) if len(below) else len(fitted)
        longest = max(longest, end)
        panel.set_yscale("log")
        _draw_both(panel, time_s, measured, fitted[:end])
        panel.axhline(noise, color="black", linewidth=0.8, linestyle=":", label="noise in the band")
        unit = f"{plot.number(frequency, 4)} Hz, {UNITS[record.quantity]}"
        panel.set(ylim=(_BELOW_NOISE * noise, 2.0 * top), ylabel=unit)
    for panel in column:  # to a little after the decay, to show the noise
        panel.set_xlim(time_s[0], time_s[min(round(1.25 * longest), len(time_s) - 1)])
    column[-1].set_xlabel(_FILE_TIME if found.decay else "time since the impact in s")
    plot.legend_above(column[0])
    return column[0]


def plot_spectrum(found: Identification, ax: Axes | None = None) -> Axes:
    """Amplitude spectrum of a decay with its peaks labelled.

    Args:
        found: an identification from decays.
        ax: where to draw; None: a new figure.

    Returns:
        The panel.
    """
    spectrum = decay_spectrum(found.fitted_records[0])
    seen = _seen(spectrum.frequency_hz, found, [peak.frequency_hz for peak in spectrum.peaks])
    panel = plot.axes(ax, size_inch=(9.0, 4.5), title="Spectrum of the free decay")
    amplitude = spectrum.amplitude[seen]
    top = float(amplitude.max())
    panel.semilogy(spectrum.frequency_hz[seen], amplitude, color=plot.COLOURS[1], linewidth=1.2)
    panel.margins(x=0.01)
    lowest = max(_BELOW_NOISE * float(np.median(amplitude)), _MIN_SHOWN * top)
    panel.set(xlabel="frequency in Hz", ylabel=_quantity(found.taps[0]), ylim=(lowest, 3.0 * top))
    for peak in spectrum.peaks:
        if peak.frequency_hz <= spectrum.frequency_hz[seen][-1]:
            top_of = peak.frequency_hz, peak.amplitude
            panel.annotate(peak.label, top_of, (0, 6), textcoords="offset points", ha="center")
    return panel


def plot_sweep(found: Identification, ax: Axes | None = None) -> Axes:
    """Amplitude of a sweep relative to its command, measured and modelled.

    Args:
        found: an identification from a sweep.
        ax: where to draw; None: a new figure.

    Returns:
        The panel.
    """
    sweep = found.sweep
    assert sweep is not None
    panel = plot.axes(ax, size_inch=(9.0, 4.5))
    panel.set_yscale("log")
    _draw_both(panel, sweep.frequency_hz, sweep.amplitude, sweep.fitted)
    panel.set(xlabel="frequency in Hz", ylabel="acceleration over that\nof the command, any unit")
    _mark_modes([panel], found)
    plot.legend_above(panel)
    return panel


def _quantity(record: Record) -> str:
    return f"{record.quantity} in {UNITS[record.quantity]}"


def _as_fitted(found: Identification) -> list[Record]:
    return [
        replace(record, response=np.asarray(fitted))
        for record, fitted in zip(found.fitted_records, found.fitted, strict=True)
    ]


def _spectrum(found: Identification) -> tuple[FloatArray, FloatArray]:
    """Frequencies; RMS of the records' amplitude spectra (2/n |FFT|), or magnitude of the first frequency response."""
    if found.responses:
        return found.responses[0].frequency_hz, np.abs(found.responses[0].response)
    parts = [record.response for record in found.fitted_records]
    count = 1 << max(map(len, parts)).bit_length()
    squares = [(2.0 / len(part) * np.abs(np.fft.rfft(part - part.mean(), count))) ** 2 for part in parts]
    frequency = np.fft.rfftfreq(count, found.fitted_records[0].period_s)
    return np.asarray(frequency, dtype=np.float64), np.asarray(np.sqrt(np.mean(squares, axis=0)), dtype=np.float64)


def _seen(frequency_hz: FloatArray, found: Identification, peaks_hz: Sequence[float] = ()) -> slice:
    """Range of frequencies to draw: without 0 Hz, to well above the highest mode or peak."""
    marked = [*peaks_hz, *(mode.frequency_hz.value for mode in (*found.modes, *found.refused))]
    highest = _SHOWN_ABOVE * max(marked, default=frequency_hz[-1] / _SHOWN_ABOVE)
    return slice(int(frequency_hz[0] == 0.0), int(np.searchsorted(frequency_hz, highest)))


def _mark_modes(column: list[Axes], found: Identification) -> None:
    for mode in (*found.modes, *found.refused):
        hertz, style = mode.frequency_hz.value, ":" if mode.refusal else "--"
        for panel in column:
            panel.axvline(hertz, color="black", linewidth=0.6, linestyle=style)
        column[0].annotate(
            f"{plot.number(hertz, 4)} Hz", (hertz, 0.98), (3, 0), xycoords=("data", "axes fraction"),
            textcoords="offset points", va="top", fontsize=8,
        )  # fmt: skip
