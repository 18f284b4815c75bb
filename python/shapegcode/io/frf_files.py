"""Reads frequency responses: text with columns, MATLAB files (versions 4 to 7, by SciPy), and results of auto servo
tuning (AST) saved by SINUMERIK Operate: response of a drive's motor to its torque.

Sources of the latter's format: eliasrhoden/Trace-Tools (MIT), `tuning_files.py` and `b85.py`.
"""

import base64
import binascii
import codecs
import io
import os
import re
import subprocess
import sys
from pathlib import Path
from typing import Any
from xml.etree.ElementTree import Element, TreeBuilder
from xml.parsers import expat

import numpy as np

from shapegcode.errors import RecordError
from shapegcode.io.data_file import MAX_DEPTH, open_file, read_file
from shapegcode.io.record import (
    FEWEST_LINES,
    ComplexArray,
    FrequencyResponse,
    ReadOptions,
    checked_response,
    frequency_factor,
    scale_of,
)
from shapegcode.io.table import TextTable, utf8_text
from shapegcode.io.units import FloatArray, Label, tap_label, words_of

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
_BARE_COLUMNS = (3, 4)  # allowed numbers of columns without a header: frequency, real, imaginary (and coherence)


def part_of(text: str) -> str | None:
    """The part of a frequency response that a column contains, by its header; None: not known."""
    if re.search(r"\|[^|]+\|", text):
        return "magnitude"
    return next((_WORDS[word] for word in words_of(text) if word in _WORDS), None)


def is_frf_text(path: Path, options: ReadOptions) -> bool:
    """Whether a text file is a frequency response: .frf, or columns of frequency and complex values, none of time."""
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
    said = {part: f"{header[index]} {units[index]}" for part, index in places.items()}
    values = table.numbers(list(places.values()), FEWEST_LINES)
    column = dict(zip(places, values.T, strict=True))
    polar = "magnitude" in column
    label, other = said["magnitude" if polar else "real"].strip(), said.get("imaginary", "").strip()
    warnings: list[str] = []
    above = utf8_text(path)[:20_000].decode("utf-8", "replace").splitlines()[: table.layout.first_row - 1]
    preamble = (line.strip(" #%/*\t;,") for line in above)
    text = next((each for each in (label, other, *preamble) if _says(each)), label)
    if path.suffix.lower() == ".frf" and not _says(text) and options.quantity is None and options.response_unit is None:
        warnings.append(f"{path}: no unit: displacement over force in m/N is assumed, as in CutPro")
        text = "receptance m/N"
    quantity, factor, told = scale_of(table.where, text, options)
    warnings += told
    values_of = _polar(column, said, warnings) if polar else column["real"] + 1j * column["imaginary"]
    frequency = column["frequency"] * frequency_factor(said["frequency"])
    rows = np.flatnonzero(np.diff(frequency) <= 0.0)
    if rows.size:
        row = int(rows[0]) + 1
        raise RecordError(
            f"{path}:{table.line_of(row)}: frequency {frequency[row]:.9g} Hz comes after {frequency[row - 1]:.9g} Hz: "
            "must ascend"
        )
    if not table.layout.header:
        warnings.append(f"{path}: no header: the columns are assumed to be frequency in Hz, real and imaginary part")
    lines = frequency, values_of, column.get("coherence")
    return [checked_response(str(path), *lines, quantity, options.axis, warnings, factor=factor)]


def _blank_cells(path: Path, table: TextTable) -> list[str]:
    """Header cells separated by blanks, with units: ``Frequency [Hz] Real [m/N]``; empty if not one per column."""
    line = utf8_text(path).split(b"\n")[table.layout.header_line - 1].decode("utf-8", "replace")
    cells = re.findall(r"[^\s\[(]+(?:\s*[\[(][^\])]*[\])]+)?", line.strip(" #%/*\r\n"))
    return cells if len(cells) == table.layout.columns else []


def _says(text: str) -> bool:
    """Whether a text states quantity or unit of a response over force."""
    try:
        scale_of("", text, ReadOptions())
    except RecordError:
        return False
    return True


def _places(table: TextTable, header: list[str], options: ReadOptions) -> dict[str, int]:
    """Column index of each part: frequency, real and imaginary part or magnitude and phase, coherence if present."""
    if not any(header):
        if len(header) not in _BARE_COLUMNS:
            raise RecordError(
                f"{table.path}: {len(header)} columns and no header; required: frequency, real and imaginary part "
                "(and coherence), or a header that names the columns"
            )
        return dict(zip(("frequency", "real", "imaginary", "coherence"), range(len(header)), strict=False))
    found: dict[str, list[int]] = {}
    for index, text in enumerate(header):
        part = part_of(text)
        if part is not None:
            found.setdefault(part, []).append(index)
    if options.axis is not None:
        axes = [next((word for word in words_of(text) if word in {"x", "y", "z"}), None) for text in header]
        along = {part: [k for k in ks if axes[k] in {options.axis, None}] for part, ks in found.items()}
        found = {part: along[part] or ks for part, ks in found.items()}
    pairs = [pair for pair in (("real", "imaginary"), ("magnitude", "phase")) if set(pair) <= set(found)]
    listed = ", ".join(repr(text) for text in header)
    if "frequency" not in found or not pairs:
        raise RecordError(
            f"{table.where}: columns are missing: frequency, and real and imaginary part or magnitude and "
            f"phase; the header names {listed}"
        )
    wanted = ["frequency", *pairs[0], *(["coherence"] if "coherence" in found else [])]
    for part in wanted:
        if len(found[part]) > 1:
            raise RecordError(
                f"{table.where}: {len(found[part])} columns of the {part}: one response per file, or one for each axis "
                f"chosen with --axis; the header names {listed}"
            )
    return {part: found[part][0] for part in wanted}


def _polar(column: dict[str, FloatArray], said: dict[str, str], warnings: list[str]) -> ComplexArray:
    magnitude, phase, unit = column["magnitude"], column["phase"], said["phase"].lower()
    if re.search(r"\bdb\b", said["magnitude"], re.IGNORECASE):
        magnitude = 10.0 ** (magnitude / _DB)
    degrees = "rad" not in unit
    if degrees and not re.search(r"deg|grad|°", unit):
        degrees = bool(np.ptp(phase) > 4.0 * np.pi)
        warnings.append(f"the phase has no unit: {'degrees' if degrees else 'radians'} are assumed")
    return np.asarray(magnitude * np.exp(1j * (np.radians(phase) if degrees else phase)), dtype=np.complex128)


_FREQUENCIES = ("f", "freq", "frequency", "freqs", "frequencies", "f_hz", "freq_hz", "hz")
_ANGULAR = ("w", "omega", "om")
_COHERENCES = ("coh", "coherence", "gamma2", "c")
#: Runs in a separate process with limits: SciPy's reader crashes on damaged files and trusts their sizes.
_READER = """
import os, sys, io, warnings
try:
    import resource
    size = os.fstat(0).st_size
    resource.setrlimit(resource.RLIMIT_AS, (768 * 2**20 + 4 * size,) * 2)
    resource.setrlimit(resource.RLIMIT_CPU, (6 + size // 2**20,) * 2)
    resource.setrlimit(resource.RLIMIT_CORE, (0, 0))
except ImportError:  # a system without limits
    pass
try:
    import numpy as np
    from scipy.io import loadmat
    warnings.simplefilter("ignore")
    held = {}
    for name, value in loadmat(sys.stdin.buffer, squeeze_me=True, struct_as_record=False).items():
        fields = getattr(value, "_fieldnames", None)
        if not name.startswith("__"):
            held |= {name: value} if fields is None else {field: getattr(value, field) for field in fields}
    kinds = dict.fromkeys("biuf", "f8") | {"c": "c16", "U": str}
    arrays = [np.asarray(value) for value in held.values()]
    arrays = [
        each.astype(kinds[each.dtype.kind]) if each.dtype.kind in kinds else np.array("no numbers") for each in arrays
    ]
    if sum(each.nbytes for each in arrays) > 200 * 2**20:
        raise ValueError("its variables take more than 200 MB: save the frequency response alone")
    stream = io.BytesIO()
    np.savez(stream, *arrays, names=np.array(list(held), dtype=str))
    sys.stdout.buffer.write(stream.getbuffer())
except MemoryError:
    sys.exit("its variables need too much memory")
except Exception as error:  # SciPy raises what its parts do
    sys.exit(str(error) or type(error).__name__)
"""


def is_mat(path: Path, head: bytes) -> bool:
    """Whether a file is a MATLAB file."""
    return head[:6] == b"MATLAB" or path.suffix.lower() == ".mat"


def read_frf_mat(path: Path, options: ReadOptions) -> list[FrequencyResponse]:
    """Read a frequency response from a MATLAB file: a vector of frequencies; a complex response or its two parts."""
    held = _variables(path)
    listed = ", ".join(f"{name} {_shape(value)}" for name, value in held.items()) or "nothing"
    name = next((each for each in held if each.lower() in (*_FREQUENCIES, *_ANGULAR)), None)
    if name is None:
        raise RecordError(
            f"{path}: no vector of frequencies (f, freq, frequency, or w in rad/s); the file contains {listed}"
        )
    frequency = np.ravel(np.asarray(held[name], dtype=np.float64))
    if name.lower() in _ANGULAR:
        frequency = frequency / (2.0 * np.pi)
    found, response = _response(path, held, len(frequency), options, listed)
    coherences = (held[each] for each in held if each.lower() in _COHERENCES and each != found)
    coherence = next((np.ravel(np.asarray(each, float)) for each in coherences), None)
    if coherence is not None and len(coherence) != len(frequency):
        coherence = None
    label = " ".join(str(value) for key, value in held.items() if isinstance(value, str) and "unit" in key.lower())
    quantity, factor, warnings = scale_of(f"{path}: {found}", label or found, options)
    lines = frequency, response, coherence
    return [checked_response(str(path), *lines, quantity, options.axis, warnings, factor=factor)]


def _variables(path: Path) -> dict[str, Any]:
    """Read the variables of the file; those of a structure by field name."""
    with open_file(path) as file:
        head = file.read(1024)
        if b"MATLAB 7.3" in head[:128] or b"\x89HDF" in head:
            raise RecordError(
                f"{path}: a MATLAB file of version 7.3 (HDF5), which is not supported: in MATLAB save it again with "
                "save('file.mat', 'f', 'H', '-v7'), or export frequency, real and imaginary part as text"
            )
        file.seek(0)
        # -P: import no module from the current folder.
        environment = {**os.environ, "OPENBLAS_NUM_THREADS": "1"}
        done = subprocess.run(
            [sys.executable, "-P", "-c", _READER], stdin=file, capture_output=True, check=False, env=environment
        )
    if done.returncode:
        said = done.stderr.decode(errors="replace").strip()[-200:] if done.returncode > 0 else "it is damaged"
        raise RecordError(f"{path}: the MATLAB file cannot be read: {said}")
    with np.load(io.BytesIO(done.stdout), allow_pickle=False) as held:
        values = [held[f"arr_{rank}"] for rank in range(len(held.files) - 1)]
        names = [str(name) for name in held["names"]]
    return {
        name: str(value[()]) if value.dtype.kind == "U" and value.ndim == 0 else value
        for name, value in zip(names, values, strict=True)
    }


def _shape(value: Any) -> str:
    if isinstance(value, str):
        return repr(value)
    array = np.asarray(value)
    return f"({' x '.join(map(str, array.shape)) or '1'}{', complex' if np.iscomplexobj(array) else ''})"


def _response(path: Path, held: dict[str, Any], lines: int, options: ReadOptions, listed: str) -> tuple[str, Any]:
    wanted = options.response_columns[0] if options.response_columns else None
    if wanted is None:
        complex_ones = [name for name, value in held.items() if np.iscomplexobj(value) and np.size(value) >= lines]
        pairs = [(re_, im) for re_ in held for im in held if _is_pair(re_, im)]
        if not complex_ones and len(pairs) == 1:
            real, imaginary = (np.ravel(np.asarray(held[each], float)) for each in pairs[0])
            if len(real) == len(imaginary) == lines:
                return pairs[0][0], real + 1j * imaginary
        if len(complex_ones) != 1:
            what = "no complex variable" if not complex_ones else f"{len(complex_ones)} complex variables"
            raise RecordError(
                f"{path}: {what} of {lines} lines: choose one with --response-column NAME (or NAME:2 for its 2nd "
                f"column); the file contains {listed}"
            )
        wanted = complex_ones[0]
    name, _, column = wanted.partition(":")
    if name not in held or isinstance(held[name], str):
        raise RecordError(f"{path}: --response-column {name!r}: no such variable; the file contains {listed}")
    values = np.asarray(held[name], dtype=np.complex128)
    if values.ndim == 1 and not column:
        columns = values[:, None]
    else:
        columns = values if values.ndim == 2 and values.shape[0] == lines else values.reshape(-1, lines).T
    if columns.shape[0] != lines:
        raise RecordError(f"{path}: {name} has {values.size} values for {lines} frequencies: must be equally many")
    if not column and columns.shape[1] > 1:
        raise RecordError(
            f"{path}: {name} has {columns.shape[1]} columns: choose one with --response-column {name}:1 "
            f"to {name}:{columns.shape[1]}"
        )
    number = int(column) if column.isdigit() else 1
    if (column and not column.isdigit()) or not 1 <= number <= columns.shape[1]:
        raise RecordError(f"{path}: --response-column {wanted}: {name} has columns 1 to {columns.shape[1]}")
    return name, columns[:, number - 1]


def _is_pair(real: str, imaginary: str) -> bool:
    """Whether two names are a real and an imaginary part: Re and Im, H_real and H_imag."""
    one, other = re.sub(r"(?i)real|re", "@", real), re.sub(r"(?i)imag|im", "@", imaginary)
    return real != imaginary and "@" in one and one == other


_MAX_BYTES = 64 << 20
_SIEMENS = "0123456789abcdefghijklmnopqrstuvwxyzABCDEFGHIJKLMNOPQRSTUVWXYZ!#$`()*+-/:;=?@[]^_{|}~"
_USUAL = "0123456789ABCDEFGHIJKLMNOPQRSTUVWXYZabcdefghijklmnopqrstuvwxyz!#$%&()*+-;<=>?@^_`{|}~"
_DIGITS = str.maketrans(_SIEMENS, _USUAL)
_NEEDED = "required: the result of an auto servo tuning (Setup, Optimize), saved with its measurements"


def is_xml(head: bytes) -> bool:
    """Whether a file begins as XML does."""
    if head[:2] in {codecs.BOM_UTF16_LE, codecs.BOM_UTF16_BE}:
        head = head[: len(head) // 2 * 2].decode("utf-16", errors="replace").encode("utf-8")
    return head.lstrip(b"\xef\xbb\xbf \t\r\n")[:5] == b"<?xml"


def read_servo_tuning(path: Path, options: ReadOptions) -> list[FrequencyResponse]:
    """Read the structure's response at the motor per unit of torque, for a linear axis.

    The control holds the motor, so the structure vibrates at the antiresonances: where torque over speed is
    largest, not speed over torque. With the apparent inertia J - sum m s²/(s² + 2 zeta w s + w²) of such
    a structure, the result is -torque/acceleration, an accelerance of unknown scale.
    """
    root = _root(path)
    axis, warnings = _axis(path, root)
    if options.axis and axis and options.axis != axis:
        raise RecordError(f"{path}: contains the {axis.upper()} axis, but {options.axis.upper()} is requested")
    controller = next(root.iter("DynamicModelPositionController840DSL"), None)
    plant = _lines(path, controller, "m_pPlant")
    if plant is None:
        raise RecordError(f"{path}: <{root.tag}> contains no m_pPlant of a speed controller; {_NEEDED}")
    hertz, values = plant
    measured = _lines(path, controller, "m_pMeasCoherence")
    coherence = None
    if measured is not None:
        if not np.array_equal(measured[0], hertz):
            raise RecordError(f"{path}: m_pMeasCoherence has other frequencies than m_pPlant: must be the same")
        coherence = np.asarray(np.abs(measured[1]), dtype=np.float64)
    kept = (hertz > 0.0) & (np.abs(values) > 0.0)
    hertz, values = hertz[kept], values[kept]
    response = -1.0 / (2j * np.pi * hertz * values)
    lines = hertz, response, None if coherence is None else coherence[kept]
    warnings = [] if options.axis else warnings
    notes = [f"{path}: from motor torque and speed: modes with the motor held, without masses"]
    source, along = f"{path}: auto servo tuning", options.axis or axis
    return [checked_response(source, *lines, "acceleration", along, warnings, notes, where=str(path), scaled=False)]


def _root(path: Path) -> Element:
    builder, parser = TreeBuilder(), expat.ParserCreate()
    depth = 0

    def start(tag: str, attributes: dict[str, str]) -> None:
        nonlocal depth
        depth += 1
        if depth > MAX_DEPTH:
            raise RecordError(f"{path}:{parser.CurrentLineNumber}: more than {MAX_DEPTH} nested elements")
        builder.start(tag, attributes)

    def end(tag: str) -> None:
        nonlocal depth
        depth -= 1
        builder.end(tag)

    def refuse(*_: Any) -> None:
        raise RecordError(f"{path}:{parser.CurrentLineNumber}: a declared document type: measurements have none")

    parser.buffer_text = True
    parser.StartElementHandler, parser.EndElementHandler = start, end
    parser.CharacterDataHandler, parser.StartDoctypeDeclHandler = builder.data, refuse
    try:
        parser.Parse(read_file(path, _MAX_BYTES), True)
    except expat.ExpatError as error:
        raise RecordError(f"{path}:{error.lineno}: incomplete XML: {expat.ErrorString(error.code)}") from error
    except RecordError:
        raise
    except (LookupError, ValueError) as error:  # from the declared codec
        raise RecordError(f"{path}:1: {error}; required: XML in UTF-8, UTF-16 or an encoding of one byte") from error
    return builder.close()


def _axis(path: Path, root: Element) -> tuple[str | None, list[str]]:
    name = next((each.text or "" for each in root.findall("string") if each.get("name") == "m_szAxisName"), "").strip()
    linear = re.fullmatch(r"M?([XYZ])\d*", name, re.IGNORECASE)
    if linear:
        return linear[1].lower(), []
    if re.fullmatch(r"M?(A|B|C|SP|S|SPINDLE|SPINDEL)\d*", name, re.IGNORECASE):
        raise RecordError(f"{path}: axis {name} is rotary: a linear axis (X, Y or Z) is needed")
    return None, [f"{path}: axis {name!r} is not named X, Y or Z: state it with --axis"]


def _lines(path: Path, controller: Element | None, name: str) -> tuple[FloatArray, Any] | None:
    """Frequencies and values (complex or real) of the last response of a name, the one that the tuning used."""
    if controller is None:
        return None
    found = [each for each in controller.iter("FrequencyResponseFunction") if each.get("name") == name]
    if not found:
        return None
    arrays = {each.get("name"): each for each in found[-1].iter("NumericArray")}
    if not {"m_FrequencyVector", "m_ValueVector"} <= set(arrays):
        raise RecordError(f"{path}: {name} has no m_FrequencyVector and m_ValueVector")
    hertz, values = (_doubles(path, name, arrays[each]) for each in ("m_FrequencyVector", "m_ValueVector"))
    if arrays["m_ValueVector"].get("elementtype") == "ComplexNumber":
        values = values[: len(values) // 2 * 2].view(np.complex128)
    if len(hertz) != len(values):
        raise RecordError(f"{path}: {name} has {len(hertz)} frequencies and {len(values)} values: must be equally many")
    bad = np.flatnonzero(~np.isfinite(values) | ~np.isfinite(hertz))
    if bad.size:
        raise RecordError(f"{path}: value {bad[0] + 1} of {name} is not finite")
    return hertz, values


def _doubles(path: Path, name: str, array: Element) -> Any:
    """Numbers of an array: base-85 words of four bytes, high word first, a dot for 0."""
    where = f"{path}: {array.get('name')} of {name}"
    if array.get("format") != "base85":
        raise RecordError(f"{where} has the format {array.get('format')!r}; required: base85")
    text = "".join("".join(each.text or "" for each in array.iter("raw")).split())
    if unknown := set(text) - set(_SIEMENS + "."):
        raise RecordError(f"{where} has {min(unknown)!r}, which is no base-85 digit")
    try:
        data = base64.b85decode(text.replace(".", "00000").translate(_DIGITS))
    except (ValueError, binascii.Error) as error:
        raise RecordError(f"{where}: {error}") from error
    if len(data) % 8:
        raise RecordError(f"{where} is truncated: {len(data)} bytes are not a multiple of 8")
    return np.frombuffer(data, dtype=">f8").astype(np.float64)
