"""Residual vibration with the feed override turned: the table of docs/howto/feed_override.md.

Run from the root of the repository: ``python tests/benchmarks/feed_override.py``. The emitted text of the path of paper
000 at 200 mm/s is simulated and shaken by the interpreter, player and plant of the tests, which share no code with the
package.
"""

from __future__ import annotations

import sys

import places  # noqa: F401
from table import markdown

import shapegcode as sg
from judge import Mode, interpret, play, residual_um
from shapegcode.demos.path import path_program

DIAL = (0.5, 0.6, 0.7, 0.75, 0.8, 0.85, 0.9, 0.95, 1.0, 1.05, 1.1, 1.15, 1.2)


def main() -> int:
    """Print the table."""
    columns: list[list[str]] = [["blocks", "cut, s", *(f"{at:.0%}" for at in DIAL)]]
    for name in ("ask", "any"):
        machine = sg.Machine.load("vx500").with_values({"emission.override": name})
        conversion = sg.convert(path_program(200, machine), machine, shape_all=True)
        region = conversion.regions[-1]
        lines = interpret(conversion.text.decode()).lines[region.emitted_lines[0] - 1 : region.emitted_lines[1]]
        cuts = [move for record in lines for move in record.moves if move.length > 0.0]
        modes = [[Mode(m.frequency_hz, m.damping_ratio) for m in axis.modes] for axis in machine.axes.as_tuple()]
        tick = machine.controller.interpolation_period_s
        left = [residual_um(play(cuts, period_s=tick, override=at), modes, tick, still_mm=1e-9).max() for at in DIAL]
        columns.append([str(len(cuts)), f"{region.time_s.emitted:.3f}", *(f"{each:.1f}" for each in left)])
    print(markdown(["feed override", '`"ask"`, um', '`"any"`, um'], [list(row) for row in zip(*columns, strict=True)]))
    return 0


if __name__ == "__main__":
    sys.exit(main())
