"""Vibration modes of an imported machine: no dump holds any, and another machine's are never taken in silence."""

from __future__ import annotations

from shapegcode.errors import ArgumentError
from shapegcode.machine.fanuc_draft import Draft
from shapegcode.machine.machine import Machine

__all__ = ["check_axes", "take_modes"]


def check_axes(keep: str, rigid: str) -> None:
    """Whether axes are named as they can be."""
    wrong = sorted({*keep, *rigid} - set("xyz"))
    if wrong:
        raise ArgumentError(f"{', '.join(wrong)}: axes are x, y and z")
    if both := sorted({*keep} & {*rigid}):
        raise ArgumentError(f"{', '.join(both).upper()}: its modes cannot be kept and it be rigid")


def take_modes(draft: Draft, base: Machine | None, keep: str, rigid: str) -> None:
    """Keep the modes of the base where somebody says that they are those of this machine; leave them out elsewhere."""
    check_axes(keep, rigid)
    for axis in "xyz":
        modes = getattr(base.axes, axis).modes if base else ()
        key = f"axes.{axis}"
        if axis in keep:
            if not modes:
                raise ArgumentError(f"{axis.upper()}: {base.name if base else 'no base machine'} has no mode to keep")
            draft.remarks[f"{key}.rigid"] = "its modes are kept"
            continue
        for name in ("modes", "rigid"):
            draft.drop(f"{key}.{name}")
        if axis in rigid:
            draft.put(f"{key}.rigid", True)
            draft.remarks[f"{key}.rigid"] = "decided when the dump was imported"
            continue
        found = ", ".join(f"{mode.frequency_hz:g} Hz" for mode in modes)
        whose = (
            f"; {found} of {base.name} are not taken over: --keep-modes {axis.upper()} does" if base and found else ""
        )
        draft.remarks[f"{key}.modes"] = "not measured"
        draft.remarks[f"{key}.rigid"] = "assumed: not measured"
        draft.miss(
            "", f"{key}.modes: no dump holds them{whose}; identify finds them; --rigid {axis.upper()}: it has none"
        )
