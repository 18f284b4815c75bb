"""Reads CNC programs as the controller does, including cutter compensation."""

from shapegcode.errors import located_error
from shapegcode.io.units import MM_PER_INCH
from shapegcode.program.program import (
    Program,
    between_increments,
    decimal,
    end_off_grid_mm,
    given_program,
    least_increment_mm,
    written_increment_mm,
)

__all__ = [
    "MM_PER_INCH",
    "Program",
    "between_increments",
    "decimal",
    "end_off_grid_mm",
    "given_program",
    "least_increment_mm",
    "located_error",
    "written_increment_mm",
]
