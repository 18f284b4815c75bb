"""The C++ programs of this folder, built where the Makefile keeps what they need."""

from __future__ import annotations

import os
import subprocess
from pathlib import Path

from places import ROOT


def built(name: str) -> Path:
    """One of them, built again where a source changed."""
    build = ROOT / "build" / "bench"
    generator = [] if (build / "CMakeCache.txt").exists() else ["-G", "Ninja"]
    # Where the Makefile keeps CVODE; what is not there is looked for in the system.
    environment = {"SUNDIALS_ROOT": str(ROOT / ".cache" / "sundials" / "usr"), **os.environ}
    for command in (
        ["cmake", "-S", Path(__file__).parent, "-B", build, *generator],
        ["cmake", "--build", build, "--target", name],
    ):
        made = subprocess.run(command, capture_output=True, text=True, check=False, env=environment)
        if made.returncode != 0:
            raise RuntimeError(f"{command[0]} failed:\n{made.stdout}{made.stderr}")
    return build / name
