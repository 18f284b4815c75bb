"""Result of the setup: the short machine file, and the open questions."""

import re
from dataclasses import dataclass, field

from shapegcode.results.json import hidden
from shapegcode.results.result import Result
from shapegcode.results.table import Column, Table


@dataclass(frozen=True)
class OpenQuestion:
    """A value that is not known yet."""

    key: str  # key of the machine file
    value: str  # value used until it is known, with its unit
    why: str  # its origin
    command: str  # command that determines it; empty: none


@dataclass(frozen=True, repr=False, eq=False)
class MachineSetup(Result):
    """A machine file made from answers.

    Attributes:
        machine: name of the machine.
        answered: keys that were answered.
        imported: keys that came from a dump of the control or from tap tests.
        open: values without an answer, axes without modes first.
        notes: values read from files.
        warnings: usually none.
        file: the file written; empty: none.
        text: the machine file.
    """

    machine: str
    answered: tuple[str, ...]
    imported: tuple[str, ...]
    open: tuple[OpenQuestion, ...]
    notes: tuple[str, ...]
    warnings: tuple[str, ...]
    text: str = field(metadata=hidden())
    file: str = ""

    @property
    def answer(self) -> str:
        """How many values were answered and imported, and the axes whose vibration is not known."""
        count = len(self.answered)
        sentence = f"{self.machine}: {count} value{'' if count == 1 else 's'} answered, {len(self.imported)} imported"
        unknown = [each.key.split(".")[1].upper() for each in self.open if each.key.endswith(".modes")]
        return f"{sentence}; vibration of {', '.join(unknown)} is not known" if unknown else sentence

    @property
    def next_step(self) -> str:
        """The one thing to do next, in one sentence."""
        file = self.file or "MACHINE"
        command = f"`shapegcode machine show {file} --for part.nc`"
        return f"{command} ranks the unknown values by their effect on your program."

    def tables(self) -> list[Table]:
        """The unknown values; axes with the same text share a row."""
        shared: dict[tuple[str, str, str], list[str]] = {}
        for each in self.open:
            found = re.fullmatch(r"(axes\.)([xyz])(\..*)", each.key)
            stem, axis, name = found.groups() if found else (each.key, "", "")
            shared.setdefault((f"{stem}{{}}{name}", each.value, each.why), []).append(axis)
        rows = [(key.format(", ".join(axes)), value, why) for (key, value, why), axes in shared.items()]
        columns = (
            Column("open", value=lambda row: row[0], left=True),
            Column("taken as", value=lambda row: row[1], text=True),
            Column("why", value=lambda row: row[2], text=True),
        )
        return [Table("", columns, rows)] if rows else []
