"""Identified modes put into a machine file: the modes of one axis change, everything else stays byte for byte."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from pathlib import Path

from shapegcode.errors import ArgumentError, MachineError
from shapegcode.identification.mode import IdentifiedMode
from shapegcode.identification.mode_tables import ModeTables
from shapegcode.identification.other_axes import decide_axes, open_modes, require_decisions
from shapegcode.identification.result import Identification, MachineFile
from shapegcode.machine import Machine
from shapegcode.settings.load import read_text


@dataclass(frozen=True)
class MachineUpdate:
    """A machine file with identified modes in it; nothing is written yet.

    Attributes:
        text: the file, to be written as UTF-8 without translating line ends.
        machine: what it says.
        notes: what was replaced, kept, removed and added, one sentence each.
    """

    text: str
    machine: Machine
    notes: tuple[str, ...]

    def noted_in(self, found: Identification, path: str | Path) -> Identification:
        """The identification that says where its modes were put.

        Args:
            found: whose modes are in the text.
            path: of the file that was written.

        Returns:
            The same with `machine_file`.
        """
        assert found.axis is not None
        return replace(found, machine_file=MachineFile(str(path), found.axis, self.notes))


def update_machine(path: str | Path, found: Identification, *, keep_modes: str = "", rigid: str = "") -> MachineUpdate:
    """A machine file with the modes of an identification in it; see `update_machine_file`.

    Args:
        path: of the machine file, which is not touched.
        found: with modes, and the axis along which they were measured.
        keep_modes: other axes whose modes stay though nobody measured them on this machine: "yz".
        rigid: other axes that have no mode that counts; theirs are taken out.

    Returns:
        The text to write, what it says, and notes of what changed.

    Raises:
        ArgumentError: no axis; see `update_machine_file` too.
        MachineError: the file is bad, or would be.
        OSError: it cannot be read.
    """
    if found.axis is None:
        raise ArgumentError(f"{found.files[0]} does not say along which axis it was measured: add --axis x, y or z")
    return update_machine_file(
        path,
        found.axis,
        found.modes,
        source=found.source,
        refused=found.refused,
        keep_modes=keep_modes,
        rigid=rigid,
    )


def update_machine_file(
    path: str | Path,
    axis: str,
    modes: Sequence[IdentifiedMode],
    *,
    source: str,
    refused: Sequence[IdentifiedMode] = (),
    keep_modes: str = "",
    rigid: str = "",
) -> MachineUpdate:
    """Read a machine file and put identified modes into it; see `update_modes`. The file itself is not touched."""
    check_updatable(path)
    text = read_text(Path(path), MachineError)
    return update_modes(
        text, axis, modes, source=source, refused=refused, keep_modes=keep_modes, rigid=rigid, file=str(path)
    )


def check_updatable(path: str | Path) -> Machine:
    """Tell before the work what would make `update_machine_file` fail whatever the modes."""
    if isinstance(path, str) and path in Machine.builtin_names():
        raise ArgumentError(
            f"{path} is a built-in machine, which stays as it is: shapegcode machine init {path} -o mine.toml makes a "
            "file of it that can be updated"
        )
    return Machine.load(path)


def update_modes(
    text: str,
    axis: str,
    modes: Sequence[IdentifiedMode],
    *,
    source: str,
    refused: Sequence[IdentifiedMode] = (),
    keep_modes: str = "",
    rigid: str = "",
    file: str = "<text>",
) -> MachineUpdate:
    """The text of a machine file with the modes of one axis replaced by identified ones.

    A mode whose frequency is within 10 % of one in the file takes its table: values and uncertainties change where
    they stand, participation, `frequency_over` and every comment line stay, and so does an uncertainty of the
    frequency that somebody stated wider than it was measured. A mode of the file that the test shows, but does not
    support, stays as it is. Other tables of the axis' modes go, other modes get a table of their own, whose
    participation is its share of the residues. Putting the same modes in twice gives the same text.
    """
    if axis not in ("x", "y", "z"):
        raise ArgumentError(f"axis {axis!r}: must be x, y or z")
    if not modes:
        raise ArgumentError(f"no mode that the data support: {file} stays as it is")
    for mode in modes:
        if mode.refusal:
            raise ArgumentError(f"the mode at {mode.frequency_hz.value:g} Hz is not supported: {mode.refusal}")
    mark = "\ufeff" if text.startswith("\ufeff") else ""
    body = text.removeprefix(mark)
    if axis in rigid:
        raise ArgumentError(f"{axis.upper()}: it cannot be rigid, a mode of it was measured")
    require_decisions(open_modes(Machine.from_toml(body, file), axis), keep_modes, rigid, file)
    tables = ModeTables(body, axis, source, file)
    new, notes = decide_axes(tables.put(modes, refused), keep_modes, rigid, file)
    machine = Machine.from_toml(new, file)
    return MachineUpdate(mark + new, machine, (*tables.notes, *notes, *_unknown(machine)))


def _unknown(machine: Machine) -> Iterator[str]:
    """A note on axes of which nobody knows whether they have a mode."""
    names = [
        name for name, axis in zip("XYZ", machine.axes.as_tuple(), strict=True) if not axis.modes and not axis.rigid
    ]
    if names:
        letters = "".join(names)
        yield f"no mode of {', '.join(names)} is known: tap, or say --rigid {letters}; until then taken as rigid"
