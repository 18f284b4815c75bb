"""Axes of a log that are X, Y and Z of a machine, and what is known of them as keys of the machine file."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

from shapegcode.characterization.servo.record import ServoRecord
from shapegcode.characterization.servo.result import ServoAxis
from shapegcode.errors import ArgumentError
from shapegcode.machine import Machine

__all__ = ["learned", "machine_axes"]


def machine_axes(record: ServoRecord, axes: str | Mapping[str, str] | None) -> dict[str, int]:
    """Which axes of a log are X, Y and Z of the machine."""
    if axes is None:
        named = {each.name.partition("(")[2].rstrip(")") or each.name: rank for rank, each in enumerate(record.axes)}
        found = {
            letter: named[name] for letter in "xyz" for name in (f"{letter.upper()}1", letter.upper()) if name in named
        }
        turning = [letter for letter, rank in found.items() if record.axes[rank].unit == "deg"]
        return {} if turning else found
    if isinstance(axes, str):
        pairs = [each.partition("=") for each in axes.split(",")]
        axes = {letter.strip().lower(): name.strip() for letter, _, name in pairs}
        if any(not equals for _, equals, _ in pairs):
            raise ArgumentError(f"--axes {','.join(axes)}: must be for example X=1,Y=6,Z=2")
    found = {}
    for letter, name in axes.items():
        ranks = [
            rank
            for rank, each in enumerate(record.axes)
            if str(name).lower() in (each.name.lower(), *each.name.lower().replace("(", "").replace(")", "").split())
        ]
        if letter.lower() not in ("x", "y", "z") or len(ranks) != 1:
            held = ", ".join(each.name for each in record.axes)
            raise ArgumentError(f"--axes {letter}={name}: must be X, Y or Z and an axis of the log, which has {held}")
        found[letter.lower()] = ranks[0]
    return found


def learned(
    machine: Machine, axes: Sequence[ServoAxis], places: Mapping[str, int]
) -> tuple[Machine, dict[str, float], list[str]]:
    """The machine with gain and feed-forward of the axes that tell them."""
    written: dict[str, float] = {}
    remarks: dict[str, list[str]] = {}
    warnings: list[str] = []
    for letter, place in places.items():
        axis = axes[place]
        if axis.unit != "mm":
            warnings.append(f"axis {axis.name} turns: it is no {letter.upper()} of a machine file")
            continue
        estimates = {key: axis.parameter(name) for key, name in _KEYS.items()}
        if any(each is None or each.value is None for each in estimates.values()):
            warnings.append(f"axis {axis.name}: gain and feed-forward do not follow: {letter.upper()} keeps its values")
            continue
        for key, each in estimates.items():
            assert each is not None
            written[f"{key}.{letter}"] = round(float(each.value or 0.0), 6)
            remarks.setdefault(key, []).append(f"{letter} {each.low:.6g} ... {each.high:.6g}")
    if not written:
        return machine, written, warnings
    said = {key: f"measured (log, behind a dead time): {', '.join(each)}" for key, each in remarks.items()}
    return machine.with_values(written).with_remarks(said), written, warnings


_KEYS = {"controller.position_gain_per_s": "position gain", "controller.feed_forward_ratio": "feed-forward"}
