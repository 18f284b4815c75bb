"""Entries of LinuxCNC's INI files."""

import re

from shapegcode.io.units import MM_PER_INCH

UNITS_MM = {"mm": 1.0, "metric": 1.0, "inch": MM_PER_INCH, "in": MM_PER_INCH, "imperial": MM_PER_INCH}
"""Values of [TRAJ] LINEAR_UNITS, in lower case."""

_SECTION = re.compile(r"\[\s*([^\]]+?)\s*\]")
_ENTRY = re.compile(r"([A-Za-z0-9_]+)\s*=\s*(.*?)\s*(?:[;#].*)?")


def ini_entries(text: str) -> dict[tuple[str, str], tuple[str, int]]:
    """Value and line number by section and name (capitals); of equal names the first counts, as in LinuxCNC."""
    entries: dict[tuple[str, str], tuple[str, int]] = {}
    section = ""
    for number, raw in enumerate(text.splitlines(), start=1):
        line = raw.strip()
        if found := _SECTION.match(line):
            section = found[1].upper()
        elif line and line[0] not in "#;" and (entry := _ENTRY.fullmatch(line)):
            entries.setdefault((section, entry[1].upper()), (entry[2], number))
    return entries
