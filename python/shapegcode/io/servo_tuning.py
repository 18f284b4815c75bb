"""Reads results of auto servo tuning (AST) saved by SINUMERIK Operate: response of a drive's motor to its torque.

Sources of the format: eliasrhoden/Trace-Tools (MIT), `tuning_files.py` and `b85.py`.
"""

import base64
import binascii
import codecs
import re
from pathlib import Path
from typing import Any
from xml.etree.ElementTree import Element, TreeBuilder
from xml.parsers import expat

import numpy as np

from shapegcode.errors import RecordError
from shapegcode.io.data_file import MAX_DEPTH, read_file
from shapegcode.io.record import FrequencyResponse, ReadOptions, checked_response
from shapegcode.io.units import FloatArray

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
        raise RecordError(f"{path}: contains the {axis.upper()} axis, asked for is {options.axis.upper()}")
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
    """Frequencies and complex values of a response; the last one of its name, which the tuning used."""
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
