"""LinuxCNC's stand-alone interpreter rs274 as an independent judge of what a program means."""

from __future__ import annotations

import functools
import os
import subprocess
from pathlib import Path

_ROOT = Path(__file__).resolve().parents[2]


@functools.cache
def _linuxcnc_folder() -> Path:
    """The unpacked LinuxCNC packages, fetched when missing. Without rs274 a test fails, it does not skip."""
    fetch = subprocess.run([_ROOT / "tests" / "tools" / "fetch_rs274.sh"], capture_output=True, text=True, check=False)
    if fetch.returncode != 0:
        raise RuntimeError(f"rs274 could not be fetched: {fetch.stderr}")
    return Path(fetch.stdout.splitlines()[-1])


def run_rs274(program_text: str, tmp_path: Path, *, tools: str = "", variables: str = "") -> list[str]:
    """The canonical lines that rs274 prints for the program, as they come: `1 N..... STRAIGHT_FEED(...)`.

    `tools` is the text of a tool table, `variables` that of a parameter file; their lengths are inches.

    Raises RuntimeError with rs274's message when it rejects the program.
    """
    linuxcnc = _linuxcnc_folder()
    program = tmp_path / "program.ngc"
    program.write_text(program_text)
    tool_table, parameters = tmp_path / "tools.tbl", tmp_path / "variables.var"
    tool_table.write_text(tools)
    parameters.write_text(variables)  # rs274 rewrites it: every run starts from this one
    # PYTHON* variables of our own interpreter must not reach the one inside rs274.
    environment = {name: value for name, value in os.environ.items() if not name.startswith("PYTHON")}
    environment |= {
        "HOME": str(tmp_path),
        "LD_LIBRARY_PATH": f"{linuxcnc}/usr/lib:{linuxcnc}/usr/lib/x86_64-linux-gnu",
    }
    run = subprocess.run(
        [linuxcnc / "usr/bin/rs274", "-g", "-t", tool_table, "-v", parameters, program],
        env=environment,
        cwd=tmp_path,
        stdin=subprocess.DEVNULL,
        capture_output=True,
        text=True,
        check=False,
    )
    if run.returncode != 0:
        raise RuntimeError(f"rs274 rejects the program (exit {run.returncode}): {run.stderr.strip()}")
    return run.stdout.splitlines()
