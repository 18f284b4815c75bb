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
from shapegcode.program.reading import program_loader, reader_options

__all__ = [
    "MM_PER_INCH",
    "Program",
    "between_increments",
    "decimal",
    "end_off_grid_mm",
    "given_program",
    "least_increment_mm",
    "located_error",
    "program_loader",
    "reader_options",
    "written_increment_mm",
]
