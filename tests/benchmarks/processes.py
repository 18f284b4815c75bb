"""The commands that are timed as whole processes."""

from __future__ import annotations

import json
import os
import subprocess
import sys
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from types import MappingProxyType

from places import ROOT

_LAUNCHER = Path(__file__).with_name("launch.py")


@dataclass(frozen=True)
class Run:
    """One finished process."""

    exit_code: int
    messages: str
    wall_s: float
    cpu_s: float
    peak_mb: float


class Rs274:
    """LinuxCNC's stand-alone interpreter; its canonical lines go to /dev/null."""

    def __init__(self, folder: Path) -> None:
        fetch = subprocess.run(
            [ROOT / "tests" / "tools" / "fetch_rs274.sh"], stdout=subprocess.PIPE, text=True, check=True
        )
        linuxcnc = Path(fetch.stdout.splitlines()[-1])
        self._program = linuxcnc / "usr/bin/rs274"
        self._tools, self._variables = folder / "tools.tbl", folder / "variables.var"
        self._tools.write_text("")
        # PYTHON* variables of our own interpreter must not reach the one inside rs274.
        self._environment = {name: value for name, value in os.environ.items() if not name.startswith("PYTHON")}
        self._environment |= {
            "HOME": str(folder),
            "LD_LIBRARY_PATH": f"{linuxcnc}/usr/lib:{linuxcnc}/usr/lib/x86_64-linux-gnu",
        }

    def read(self, program: Path) -> Run:
        """Interpret a program."""
        return launched(self._command(program), self._environment)

    def count_feed_moves(self, program: Path) -> int:
        """How many straight feed moves it finds: proof that it reads what we time."""
        run = subprocess.run(
            self._command(program), env=self._environment, stdin=subprocess.DEVNULL, capture_output=True,
            text=True, check=True,
        )  # fmt: skip
        return run.stdout.count("STRAIGHT_FEED(")

    def _command(self, program: Path) -> list[str | Path]:
        self._variables.write_text("")  # rs274 rewrites it: every run starts from an empty one
        return [self._program, "-g", "-t", self._tools, "-v", self._variables, program]


def convert(program: Path, output: Path, values: Mapping[str, int] = MappingProxyType({})) -> Run:
    """`shapegcode convert` for the built-in VX500 with some values moved, with round trip and plant."""
    command = [Path(sys.executable).with_name("shapegcode"), "convert", program, "-m", "vx500", "-o", output]
    command += [word for key, value in values.items() for word in ("--set", f"{key}={value}")]
    return launched(command, os.environ, accepted=(0, 1))  # 1: written, but out of tolerance


def launched(command: Sequence[str | Path], environment: Mapping[str, str], accepted: Sequence[int] = (0,)) -> Run:
    launcher = [sys.executable, "-I", "-S", _LAUNCHER, *command]
    text = subprocess.run(launcher, env=dict(environment), stdout=subprocess.PIPE, text=True, check=True).stdout
    run = Run(**json.loads(text))
    if run.exit_code not in accepted:
        raise RuntimeError(f"{' '.join(map(str, command))} ended with exit code {run.exit_code}: {run.messages}")
    return run
