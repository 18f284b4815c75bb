"""A frequency response without its time record: lines of response over force, in SI units."""

from __future__ import annotations

import re
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from shapegcode.errors import RecordError
from shapegcode.io.columns import words_of
from shapegcode.io.record import Quantity, ReadOptions, stated_unit
from shapegcode.io.units import FloatArray, Unit, find_unit

ComplexArray = npt.NDArray[np.complex128]

FEWEST_LINES = 16  # fewer lines do not determine a mode with its damping
_RESPONSES: tuple[Quantity, ...] = ("acceleration", "velocity", "displacement")
_NAMES: dict[str, Quantity] = {
    "receptance": "displacement", "compliance": "displacement", "flexibility": "displacement",
    "admittance": "displacement", "mobility": "velocity", "accelerance": "acceleration", "inertance": "acceleration",
}  # fmt: skip


@dataclass(frozen=True, eq=False)
class FrequencyResponse:
    """Response over force at one point, line by line.

    Attributes:
        source: file and dataset or column, for messages.
        frequency_hz: (n,), ascending, above 0; evenly spaced or not.
        response: (n,) complex, in m/s², m/s or m per N by `quantity`.
        quantity: response quantity, which was divided by the force.
        coherence: (n,) 0 to 1; None: not in the file.
        axis: "x", "y" or "z" None if the file does not state it.
        warnings: assumptions made on reading.
        notes: parts ignored on reading.
        scaled: False: the force is known only up to a factor (a motor's torque), so that no mass follows.
    """

    source: str
    frequency_hz: FloatArray
    response: ComplexArray
    quantity: Quantity = "acceleration"
    coherence: FloatArray | None = None
    axis: str | None = None
    warnings: tuple[str, ...] = ()
    notes: tuple[str, ...] = ()
    scaled: bool = True

    def __post_init__(self) -> None:
        count = len(self.frequency_hz)
        named = {"frequencies": self.frequency_hz, "lines": self.response, "coherence": self.coherence}
        for what, values in named.items():
            if values is None:
                continue
            bad = np.flatnonzero(~np.isfinite(values))
            if bad.size:
                raise RecordError(f"{self.source}: line {bad[0] + 1} of the {what} is {values[bad[0]]}: must be finite")
            if np.ndim(values) != 1 or len(values) != count:
                raise RecordError(f"{self.source}: {len(values)} {what} for {count} frequencies: must be equally many")
        if count < FEWEST_LINES:
            raise RecordError(f"{self.source}: {count} lines of a frequency response; required: {FEWEST_LINES} or more")
        if self.frequency_hz[0] <= 0.0 or np.any(np.diff(self.frequency_hz) <= 0.0):
            raise RecordError(f"{self.source}: the frequencies must be above 0 and ascend")
        if not np.any(self.response):
            raise RecordError(f"{self.source}: every line is 0: is it the right channel?")

    @property
    def resolution_hz(self) -> float:
        """Usual line spacing, Hz."""
        return float(np.median(np.diff(self.frequency_hz)))


_SIZES = 1e-50, 1e50  # whose fourth powers are finite


def checked_lines(
    where: str, frequency_hz: FloatArray, response: ComplexArray, coherence: FloatArray | None
) -> tuple[FloatArray, ComplexArray, FloatArray | None, list[str]]:
    """Check lines for a `FrequencyResponse`, without the line at 0 Hz."""
    steps = np.diff(frequency_hz)
    if np.any(steps <= 0.0):
        row = int(np.flatnonzero(steps <= 0.0)[0]) + 1
        raise RecordError(
            f"{where}: frequency {frequency_hz[row]:.9g} Hz of value {row + 1} comes after {frequency_hz[row - 1]:.9g} "
            "Hz: must ascend"
        )
    if len(frequency_hz) and frequency_hz[0] < 0.0:
        raise RecordError(f"{where}: frequency {frequency_hz[0]:.9g} Hz: must be 0 or more")
    if coherence is not None and (np.any(coherence < 0.0) or np.any(coherence > 1.0 + 1e-6)):
        row = int(np.flatnonzero((coherence < 0.0) | (coherence > 1.0 + 1e-6))[0])
        raise RecordError(f"{where}: coherence {coherence[row]:.6g} of value {row + 1}: must be from 0 to 1")
    size = np.abs(response)
    strange = np.flatnonzero((size > _SIZES[1]) | ((size < _SIZES[0]) & (size > 0.0)))
    if strange.size:
        row = int(strange[0])
        raise RecordError(
            f"{where}: value {row + 1} of the response is {size[row]:.3g}: must be 0 or from {_SIZES[0]:g} to "
            f"{_SIZES[1]:g}; is it a response?"
        )
    if len(frequency_hz) and frequency_hz[0] == 0.0:
        kept = None if coherence is None else coherence[1:]
        return frequency_hz[1:], response[1:], kept, [f"{where}: the line at 0 Hz is ignored"]
    return frequency_hz, response, coherence, []


def frequency_factor(text: str) -> float:
    """Factor to Hz, from a label."""
    return 1.0 / (2.0 * np.pi) if "rad" in text.lower() else 1000.0 if "khz" in text.lower() else 1.0


def ratio_unit(text: str) -> tuple[Unit, float] | None:
    """Unit of a response over a force: ``m/N``, ``(m/s²)/N``, ``µm/N``, ``g/N``, ``m/s^2/N``, ``1/kg``."""
    plain = text.strip().strip("[]")
    if re.fullmatch(r"(1/kg|kg\^?-1)", plain):
        unit = find_unit("m/s²")
        return None if unit is None else (unit, 1.0)
    match = re.fullmatch(r"(.+?)\s*/\s*\(?\s*(k?N|kgf|lbf)\s*\)?\s*[·*.]?\s*(s(?:\^?2|²)?)?\s*\)?", plain)
    if match is None:
        return None
    numerator = match[1].strip()
    if match[3]:  # m/(N s), m/(N·s²)
        numerator = f"{numerator.strip('( ')}/{match[3].replace('2', '²').replace('^', '')}"
    unit = find_unit(numerator.replace("(", "").replace(")", ""))
    force = find_unit(match[2])
    if unit is None or force is None or unit.measures not in _RESPONSES:
        return None
    return unit, unit.factor / force.factor


def scale_of(where: str, label: str, options: ReadOptions) -> tuple[Quantity, float, list[str]]:
    """Quantity and factor to SI of a response over force, by options, unit or name."""
    force = stated_unit(options.force_unit, ("force",))
    over = options.force_scale or (1.0 if force is None else force.factor)
    named = options.quantity or next((_NAMES[word] for word in words_of(label) if word in _NAMES), None)
    stated = stated_unit(options.response_unit, _RESPONSES)
    if options.response_scale is not None:
        if named is None:
            raise RecordError(f"{where}: --response-scale needs --quantity acceleration, velocity or displacement")
        return named, options.response_scale / over, []
    if stated is not None:
        measures = next(each for each in _RESPONSES if each == stated.measures)
        if named not in {None, measures}:
            raise RecordError(f"{where}: --response-unit {stated.name} is of {measures}, the response is {named}")
        return measures, stated.factor / over, []
    # In brackets, after the name, or the whole text.
    inside = re.findall(r"\[([^\]]*)\]", label) + re.findall(r"\(((?:[^()]|\([^()]*\))*)\)", label)
    behind = [label[at.end() :] for at in re.finditer(r"[\s_]+", label)]
    found = next((unit for part in (*inside, *behind, label) if (unit := ratio_unit(part)) is not None), None)
    if found is not None:
        measures = next(each for each in _RESPONSES if each == found[0].measures)
        if options.quantity not in {None, measures}:
            raise RecordError(f"{where}: {label!r} is of {measures}, --quantity is {options.quantity}: must agree")
        return measures, found[1], []
    if named is not None:
        si = {"acceleration": "(m/s²)/N", "velocity": "(m/s)/N", "displacement": "m/N"}[named]
        return named, 1.0 / over, [f"{where}: the response has no unit: {si} is assumed"]
    raise RecordError(
        f"{where}: unclear whether it is displacement, velocity or acceleration over force; required: a unit such "
        "as m/N, µm/N, (m/s)/N, (m/s²)/N or g/N in the header, or --response-unit (of the response, over N), or "
        "--quantity"
    )
