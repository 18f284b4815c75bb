"""Programs in the words of controls other than FANUC's, read into plain programs in FANUC's words."""

from __future__ import annotations

from shapegcode.program.foreign.plain import ForeignProgram, ForeignSettings, Note, PlainProgram, refusal
from shapegcode.program.foreign.recognize import Recognition, recognize

__all__ = ["ForeignProgram", "ForeignSettings", "Note", "PlainProgram", "Recognition", "recognize", "refusal"]
