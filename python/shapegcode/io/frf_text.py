"""Reads frequency responses from text files with columns: frequency, real and imaginary part or magnitude and phase."""

from __future__ import annotations

import re
from pathlib import Path

import numpy as np

from shapegcode.errors import RecordError
from shapegcode.io.columns import Label, tap_label
from shapegcode.io.frequency_response import FEWEST_LINES, ComplexArray, FrequencyResponse, checked_lines, scale_of
from shapegcode.io.layout import utf8_text
from shapegcode.io.record import FloatArray, ReadOptions
from shapegcode.io.table import TextTable

_PARTS = {
    "frequency": "f freq frequency frequenz hz",
    "real": "re real realteil",
    "imaginary": "im imag imaginary imaginaer imaginär imagin",
    "magnitude": "mag magnitude amp amplitude abs modulus betrag",
    "phase": "phase phi angle arg phasenwinkel",
    "coherence": "coh coherence kohaerenz kohärenz gamma",
}
_WORDS = {word: part for part, words in _PARTS.items() for word in words.split()}
_DB = 20.0
#: Without a header: frequency, real and imaginary part, in this order, of so many columns.
_BARE_COLUMNS = (3, 4)


def part_of(text: str) -> str | None:
    """Which part of a frequency response a column holds, by its header."""
    if re.search(r"\|[^|]+\|", text):
        return "magnitude"
    words = re.findall(r"[^\W\d_]+", text.lower())
    return next((_WORDS[word] for word in words if word in _WORDS), None)


def is_frf_text(path: Path, options: ReadOptions) -> bool:
    """Whether a text file holds a frequency response: its header names a frequency and its parts, and no time."""
    if options.time_column is not None or options.period_s is not None:
        return False
    if path.suffix.lower() == ".frf":
        return True
    for line in utf8_text(path)[:20_000].decode("latin-1").splitlines()[:60]:
        cells = [cell for cell in re.split(r"[\t;,]|\s{2,}", line.strip(" #%/*")) if cell]
        if len(cells) == 1:
            cells = line.strip(" #%/*").split()
        parts = [part_of(cell) for cell in cells]
        has_time = any(tap_label(cell).measures == "time" for cell in cells)
        is_complete = {"real", "imaginary"} <= set(parts) or {"magnitude", "phase"} <= set(parts)
        if parts.count("frequency") and is_complete and not has_time:
            return True
    return False


def read_frf_text(path: Path, options: ReadOptions) -> list[FrequencyResponse]:
    """Read a frequency response from text with columns."""
    table = TextTable(path, by_number=True)
    header = [label.text for label in table.labels(lambda text, _unit: Label(text, None, None))]
    if table.layout.delimiter == " " and table.layout.header:
        header = _blank_cells(path, table) or header
    units = [*table.layout.units, *[""] * len(header)]
    places = _places(table, header, options)
    values = table.numbers(list(places.values()), FEWEST_LINES)
    column = dict(zip(places, values.T, strict=True))
    polar = "magnitude" in column
    shown = places["magnitude" if polar else "real"]
    label = f"{header[shown]} {units[shown]}".strip()
    other = "" if polar else f"{header[places['imaginary']]} {units[places['imaginary']]}".strip()
    warnings: list[str] = []
    text = next((each for each in (label, other, *_preamble(path, table)) if _says(each)), label)
    if path.suffix.lower() == ".frf" and not _says(text) and options.quantity is None and options.response_unit is None:
        warnings.append(f"{path}: no unit: displacement over force in m/N is taken, as CutPro has it")
        text = "receptance m/N"
    quantity, factor, told = scale_of(table.where, text, options)
    warnings += told
    cartesian = None if polar else np.asarray(column["real"] + 1j * column["imaginary"], dtype=np.complex128)
    values_of = _polar(column, header, units, places, warnings) if cartesian is None else cartesian
    frequency = column["frequency"] * _frequency_factor(f"{header[places['frequency']]} {units[places['frequency']]}")
    rows = np.flatnonzero(np.diff(frequency) <= 0.0)
    if rows.size:
        row = int(rows[0]) + 1
        raise RecordError(
            f"{path}:{table.line_of(row)}: frequency {frequency[row]:.9g} Hz comes after {frequency[row - 1]:.9g} Hz: "
            "must ascend"
        )
    lines, response, coherence, notes = checked_lines(str(path), frequency, values_of, column.get("coherence"))
    if not table.layout.header:
        warnings.append(f"{path}: no header: the columns are taken for frequency in Hz, real and imaginary part")
    return [
        FrequencyResponse(
            str(path), lines, response * factor, quantity, coherence, options.axis, tuple(warnings), tuple(notes)
        )
    ]


def _blank_cells(path: Path, table: TextTable) -> list[str]:
    """Cells of a header between blanks, each with the unit behind it: ``Frequency [Hz] Real [m/N]``."""
    line = utf8_text(path).split(b"\n")[table.layout.header_line - 1].decode("utf-8", "replace")
    cells = re.findall(r"[^\s\[(]+(?:\s*[\[(][^\])]*[\])]+)?", line.strip(" #%/*\r\n"))
    return cells if len(cells) == table.layout.columns else []


def _says(text: str) -> bool:
    """Whether a text says quantity or unit of a response over force."""
    try:
        scale_of("", text, ReadOptions())
    except RecordError:
        return False
    return True


def _preamble(path: Path, table: TextTable) -> list[str]:
    lines = utf8_text(path)[:20_000].decode("utf-8", "replace").splitlines()
    return [line.strip(" #%/*\t;,") for line in lines[: table.layout.first_row - 1]]


def _places(table: TextTable, header: list[str], options: ReadOptions) -> dict[str, int]:
    """Index of the column of each part."""
    if not any(header):
        if len(header) not in _BARE_COLUMNS:
            raise RecordError(
                f"{table.path}: {len(header)} columns and no header: needed are frequency, real and imaginary part "
                "(and coherence), or a header that names the columns"
            )
        return dict(zip(("frequency", "real", "imaginary", "coherence"), range(len(header)), strict=False))
    found: dict[str, list[int]] = {}
    for index, text in enumerate(header):
        part = part_of(text)
        if part is not None:
            found.setdefault(part, []).append(index)
    if options.axis is not None:
        along = {part: [k for k in ks if _axis(header[k]) in {options.axis, None}] for part, ks in found.items()}
        found = {part: along[part] or ks for part, ks in found.items()}
    pairs = [pair for pair in (("real", "imaginary"), ("magnitude", "phase")) if set(pair) <= set(found)]
    listed = ", ".join(repr(text) for text in header)
    if "frequency" not in found or not pairs:
        raise RecordError(
            f"{table.where}: needed are columns of the frequency, and of real and imaginary part or magnitude and "
            f"phase; the header names {listed}"
        )
    wanted = ["frequency", *pairs[0], *(["coherence"] if "coherence" in found else [])]
    for part in wanted:
        if len(found[part]) > 1:
            raise RecordError(
                f"{table.where}: {len(found[part])} columns of the {part}: one response a file, or one for each axis "
                f"chosen with --axis; the header names {listed}"
            )
    return {part: found[part][0] for part in wanted}


def _axis(text: str) -> str | None:
    words = re.findall(r"[^\W\d_]+", text.lower())
    return next((word for word in words if word in {"x", "y", "z"}), None)


def _frequency_factor(text: str) -> float:
    if re.search(r"rad", text, re.IGNORECASE):
        return 1.0 / (2.0 * np.pi)
    return 1000.0 if re.search(r"khz", text, re.IGNORECASE) else 1.0


def _polar(
    column: dict[str, FloatArray], header: list[str], units: list[str], places: dict[str, int], warnings: list[str]
) -> ComplexArray:
    said = f"{header[places['magnitude']]} {units[places['magnitude']]}"
    magnitude = column["magnitude"]
    if re.search(r"\bdb\b", said, re.IGNORECASE):
        magnitude = 10.0 ** (magnitude / _DB)
    said = f"{header[places['phase']]} {units[places['phase']]}".lower()
    phase = column["phase"]
    if "rad" in said:
        degrees = False
    elif re.search(r"deg|grad|°", said):
        degrees = True
    else:
        degrees = bool(np.ptp(phase) > 4.0 * np.pi)
        warnings.append(f"the phase has no unit: {'degrees' if degrees else 'radians'} are taken")
    return np.asarray(magnitude * np.exp(1j * (np.radians(phase) if degrees else phase)), dtype=np.complex128)
