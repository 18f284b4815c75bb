"""The commands that are timed as whole processes."""

from __future__ import annotations

import json
import subprocess
import sys
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from types import MappingProxyType

SHAPEGCODE = Path(sys.executable).with_name("shapegcode")
_LAUNCHER = Path(__file__).with_name("launch.py")


@dataclass(frozen=True)
class Run:
    """One finished process."""

    exit_code: int
    messages: str
    wall_s: float
    cpu_s: float
    peak_mb: float


def convert(program: Path, output: Path, values: Mapping[str, int] = MappingProxyType({})) -> Run:
    """`shapegcode convert` for the built-in VX500 with some values moved, with round trip and plant."""
    command = [SHAPEGCODE, "convert", program, "-m", "vx500", "-o", output]
    command += [word for key, value in values.items() for word in ("--set", f"{key}={value}")]
    return launched(command, accepted=(0, 1))  # 1: written, but out of tolerance


def launched(
    command: Sequence[str | Path],
    environment: Mapping[str, str] | None = None,
    *,
    folder: Path | None = None,
    accepted: Sequence[int] = (0,),
) -> Run:
    """A command in an environment (None: ours) and a folder (None: here)."""
    launcher = [sys.executable, "-I", "-S", _LAUNCHER, *command]
    done = subprocess.run(launcher, env=environment, cwd=folder, stdout=subprocess.PIPE, text=True, check=True)
    run = Run(**json.loads(done.stdout))
    if run.exit_code not in accepted:
        raise RuntimeError(f"{' '.join(map(str, command))} ended with exit code {run.exit_code}: {run.messages}")
    return run
