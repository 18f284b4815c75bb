"""A program through LinuxCNC's own simulation without a screen, with the component in it, recorded at 1 kHz."""

from __future__ import annotations

import json
import re
import shutil
import subprocess
import tempfile
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

ROOT = Path(__file__).resolve().parents[2]
HERE = Path(__file__).resolve().parent
EXAMPLE = ROOT / "integrations" / "linuxcnc" / "example"
PERIOD_S = 1e-3
MILLIONFOLD = 1e-6  # record.hal


@dataclass(frozen=True)
class Recording:
    """One row per millisecond."""

    command: NDArray[np.float64]  # what LinuxCNC gave each joint, in mm
    shaped: NDArray[np.float64]  # what came out of the component in the same millisecond
    following_error: NDArray[np.float64]  # of each joint, as LinuxCNC sees it
    pending: NDArray[np.bool_]  # the pin of the component
    ok: NDArray[np.bool_]  # the pin of the component
    cycles: NDArray[np.float64]  # that the component took the millisecond before, of the processor's counter
    said: dict[str, Any]  # errors that an operator saw; what `halcmd show` said at the end of thread and parameters


def as_user() -> list[str]:
    """The beginning of a command that runs as a user whom LinuxCNC accepts; installs what is missing."""
    done = subprocess.run([HERE / "install.sh"], check=True, stdout=subprocess.PIPE, text=True)
    return done.stdout.split()


def run(
    user: list[str],
    program: Path,
    *,
    ini: dict[str, str] | None = None,
    hal: dict[str, str] | None = None,
    **job: Any,
) -> Recording:
    """The example of the component, run with a program by operate.py, which says what else is in a job.

    `ini`, `hal`: words to replace in these files.
    """
    with tempfile.TemporaryDirectory(prefix="linuxcnc-", ignore_cleanup_errors=True) as place:
        folder = Path(place)
        for file in (*EXAMPLE.iterdir(), HERE / "record.hal", HERE / "operate.py"):
            shutil.copy(file, folder)
        shutil.copy(program, folder / "program.ngc")
        _replace(
            folder / "shaped_mill.ini",
            {
                "DISPLAY = axis": f"DISPLAY = {folder}/operate.py",
                "HALFILE = shaped_mill.hal": "HALFILE = shaped_mill.hal\nHALFILE = record.hal",
                **(ini or {}),
            },
        )
        _replace(folder / "shaped_mill.hal", hal or {})
        (folder / "job.json").write_text(json.dumps({"program": str(folder / "program.ngc"), **job}))
        (folder / "shaped_mill.var").touch()
        for file in (folder, *folder.iterdir()):
            file.chmod(0o777)
        done = subprocess.run(
            [*user, "linuxcnc", folder / "shaped_mill.ini"],
            cwd=folder,
            stdin=subprocess.DEVNULL,
            stdout=subprocess.PIPE,
            stderr=subprocess.STDOUT,
            text=True,
            check=False,
        )
        said_file = folder / "said.json"
        said = json.loads(said_file.read_text()) if said_file.is_file() else {}
        recorded = folder / "recording.txt"
        if done.returncode or not recorded.is_file():
            raise RuntimeError(f"LinuxCNC: {done.returncode}, {said.get('errors')}; it printed:\n{done.stdout}")
        return _read(recorded, said)


def _replace(file: Path, words: dict[str, str]) -> None:
    text = file.read_text()
    for old, new in words.items():
        if old not in text:
            raise RuntimeError(f"{file.name} has no {old!r}")
        text = text.replace(old, new)
    file.write_text(text)


def _read(file: Path, said: dict[str, Any]) -> Recording:
    """The whole lines of halsampler, none lost: its numbers count up by one."""
    lines = [line.split() for line in file.read_text().splitlines()[:-1]]
    if any("overrun" in line for line in lines):
        raise RuntimeError("halsampler lost samples")
    table = np.array(lines, dtype=float)
    if not np.all(np.diff(table[:, 0]) == 1.0):
        raise RuntimeError("halsampler's numbers do not count up by one")
    joints = MILLIONFOLD * table[:, 1:10]
    return Recording(
        joints[:, :3], joints[:, 3:6], joints[:, 6:9], table[:, 10] != 0.0, table[:, 11] != 0.0, table[:, 12], said
    )  # fmt: skip


def longest_cycles(said: dict[str, Any]) -> tuple[int, int]:
    """Longest time of the servo thread and of the component in cycles of the processor's counter, by `halcmd show`."""
    thread = re.search(r"servo-thread\s*\(\s*\d+,\s*(\d+)", said["thread"])
    component = re.search(r"(\d+)\s+shapegcode-shaper\.0\.tmax\b", said["parameters"])
    if thread is None or component is None:
        raise RuntimeError(f"no times in {said}")
    return int(thread[1]), int(component[1])
