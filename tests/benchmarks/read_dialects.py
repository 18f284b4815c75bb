"""How long programs for LinuxCNC and for a Sinumerik take to read, compared with an interpreter of that control.

Run from the root: ``python tests/benchmarks/read_dialects.py``. LinuxCNC's `rs274` prints the
canonical calls of a program, PyPI's `nc-gcode-interpreter` makes a table of a Sinumerik program. CPU seconds, median of
the repetitions, each of which runs both.
"""

from __future__ import annotations

import resource
import tempfile
import time
from collections.abc import Callable
from functools import partial
from pathlib import Path

import places  # noqa: F401
from nc_gcode_interpreter import nc_to_dataframe
from table import Sample, markdown, timed

import shapegcode as sg
from rs274_tool import run_rs274
from shapegcode.program.foreign.linuxcnc import read_linuxcnc
from shapegcode.program.foreign.siemens import read_siemens

REPETITIONS = 5
LINES = 100_000
PASSES = 30_000


def plain_lines(word: str) -> str:
    """Points of a curve, a line each."""
    return "".join(f"{word} X{k % 977 * 0.113:.3f} Y{k % 499 * 0.217:.3f}\n" for k in range(LINES))


LINUXCNC = {
    f"{LINES} moves": f"G21 G17 G90 G94\nF1000\n{plain_lines('G1')}M2\n",
    f"{LINES} moves with a word A": f"G21 G17 G90 G94\nF1000\n{plain_lines('G1 A0')}M2\n",
    f"a loop of {PASSES} passes, two expressions": (
        f"G21 G17 G90 G94\nF1000\n#1=0\nO100 WHILE [#1 LT {PASSES}]\nG1 X[#1*0.001] Y[10*SIN[#1]]\n#1=[#1+1]\n"
        "O100 ENDWHILE\nM2\n"
    ),
}
SIEMENS = {
    f"{LINES} moves": f"G17 G90 G94 G71\nF1000\n{plain_lines('G1')}M30\n",
    f"a loop of {PASSES} passes, two expressions": (
        f"DEF REAL COUNT=0\nG17 G90 G94 G71\nF1000\nWHILE COUNT<{PASSES}\n"
        "G1 X=COUNT*0.001 Y=COUNT*0.002-COUNT*COUNT*0.00000001\nCOUNT=COUNT+1\nENDWHILE\nM30\n"
    ),
}


def cpu_s() -> float:
    """Of this process and of those that it waited for."""
    return time.process_time() + sum(resource.getrusage(resource.RUSAGE_CHILDREN)[:2])


def main() -> None:
    """Print the table."""
    machine = sg.Machine.of("vx500")
    rows = []
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        cases: list[tuple[str, str, Callable[[], object], Callable[[], object]]] = []
        for case, text in LINUXCNC.items():
            ours = partial(read_linuxcnc, text, file="a.ngc", machine=machine)
            cases.append(("LinuxCNC", case, ours, partial(run_rs274, text, folder)))
        for case, text in SIEMENS.items():
            ours = partial(read_siemens, text, file="a.mpf", machine=machine)
            cases.append(("Sinumerik", case, ours, partial(nc_to_dataframe, text, iteration_limit=10 * PASSES)))
        for control, case, own_reader, other_reader in cases:
            pairs = [(timed(own_reader, cpu_s)[0], timed(other_reader, cpu_s)[0]) for _ in range(REPETITIONS)]
            own, other = (Sample.of(column) for column in zip(*pairs, strict=True))
            rows.append([control, case, f"{own.median:.3f}", f"{other.median:.3f}", str(own / other)])
    print(markdown(["control", "program", "read, s", "its interpreter, s", "ratio"], rows))


if __name__ == "__main__":
    main()
