"""Peak memory of conversions: what it grows by with each block, and that of a program of ten hours.

python tests/benchmarks/memory.py            # two sizes, and ten hours (some minutes)
python tests/benchmarks/memory.py --no-hours
"""

from __future__ import annotations

import argparse
import sys
import tempfile
from collections.abc import Mapping
from pathlib import Path
from types import MappingProxyType

import workload
from processes import Run, convert

_MAX_PER_BLOCK = 150  # bytes
_MAX_MB = 300  # of the program of ten hours
_HOURS_LINES = 800_000
_HOURS_SCALE = 7.5  # lines of .75 to 3.75 mm at F3000: 45 ms each


def main() -> int:
    """Measure, print, and say by the exit code whether the targets are met."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--lines", type=int, nargs=2, default=[200_000, 1_000_000], help="of the two programs")
    parser.add_argument("--no-hours", action="store_true", help="leave the program of ten hours out")
    arguments = parser.parse_args()
    with tempfile.TemporaryDirectory(prefix="shapegcode-memory-") as name:
        folder = Path(name)
        few, many = arguments.lines
        small, large = _converted(folder, few), _converted(folder, many)
        per_block = (large.peak_mb - small.peak_mb) * 1e6 / (many - few)
        print(f"{few} lines: {small.peak_mb:.0f} MB, {many} lines: {large.peak_mb:.0f} MB")
        print(f"each block more: {per_block:.0f} bytes (target {_MAX_PER_BLOCK})")
        missed = per_block > _MAX_PER_BLOCK
        if not arguments.no_hours:
            # The moves around the cut count too. There is no room then for its shaped text, which has more blocks.
            hours = _converted(folder, _HOURS_LINES, {"controller.max_program_moves": _HOURS_LINES + 10}, _HOURS_SCALE)
            roomy = _converted(folder, _HOURS_LINES, {}, _HOURS_SCALE)
            print(f"ten hours, {_HOURS_LINES} lines: {hours.peak_mb:.0f} MB (target {_MAX_MB}), {hours.wall_s:.0f} s")
            print(f"the same with room for its shaped text: {roomy.peak_mb:.0f} MB, {roomy.wall_s:.0f} s")
            missed = missed or hours.peak_mb > _MAX_MB
    return 1 if missed else 0


def _converted(folder: Path, lines: int, values: Mapping[str, int] = MappingProxyType({}), scale: float = 1.0) -> Run:
    program = folder / f"{lines}.nc"
    workload.write_program(program, lines, scale=scale)
    return convert(program, folder / "shaped.nc", values)


if __name__ == "__main__":
    sys.exit(main())
