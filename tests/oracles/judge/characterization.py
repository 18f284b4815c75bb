"""Draws controllers, lets them play written test programs, and compares what is fitted with what was hidden."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from .controller_simulator import Array, Hidden, draw, servo_log, stopwatch_s

__all__ = ["Deviation", "fill_in_logs", "fill_in_times", "truth_of", "write_csv"]


@dataclass(frozen=True)
class Deviation:
    """One fitted quantity beside its hidden truth."""

    seed: int
    quantity: str
    truth: float
    value: float | None
    low: float | None
    high: float | None

    @property
    def relative(self) -> float:
        return abs(self.value - self.truth) / self.truth if self.value is not None else float("nan")

    @property
    def covered(self) -> bool:
        return (
            self.low is not None
            and self.high is not None
            and self.low <= self.truth * (1 + 1e-9) <= self.high * (1 + 2e-9)
        )


def truth_of(hidden: Hidden) -> dict[str, float | str]:
    """The hidden facts under the names of the findings."""
    out: dict[str, float | str] = {
        "interpolation period": hidden.period_s,
        "block end": hidden.block_end,
        "block time": hidden.block_time_s,
        "cutting acceleration shape": hidden.shape,
        "cutting time constant": hidden.time_constant_s,
    }
    if hidden.shape != "exponential":
        out["cutting bell time"] = hidden.bell_s
        out["cutting time constant + bell time"] = hidden.time_constant_s + hidden.bell_s
    for index, axis in enumerate("XYZ"):
        out[f"in-position time {axis}"] = hidden.in_position_s[index]
        out[f"rapid time constant {axis}"] = hidden.rapid_time_constant_s
        out[f"rapid bell time {axis}"] = hidden.rapid_bell_s
        out[f"position gain {axis}"] = hidden.position_gain
        out[f"feed-forward {axis}"] = hidden.feed_forward
    return out


def write_csv(path: Path, table: Array) -> None:
    names = ["time_ms", "X", "Y", "Z", "X_act", "Y_act", "Z_act"][: table.shape[1]]
    scaled = table.copy()
    scaled[:, 0] *= 1e3
    np.savetxt(path, scaled, fmt="%.4f", delimiter=",", header=",".join(names), comments="")


def fill_in_times(
    folder: Path, hidden: Hidden, rng: np.random.Generator, *, resolution_s: float = 0.1, jitter_s: float = 0.0
) -> None:
    """Play what is asked for in RESULTS.toml and put the times in."""

    def value(text: str, override: float) -> str:
        time = stopwatch_s(text, hidden, rng, override=override, resolution_s=resolution_s, jitter_s=jitter_s)
        return f"times_s = [{time:.6g}]"

    new = {"reaction_s = 0.1": f"reaction_s = {jitter_s}", "resolution_s = 0.1": f"resolution_s = {resolution_s}"}
    _edit(folder, "times_s = []", value, new)


def _edit(folder: Path, marker: str, value: Callable[[str, float], str], also: dict[str, str]) -> None:
    program, override, out = "", 1.0, []
    results = (folder / "RESULTS.toml").read_text()
    for old, new in also.items():
        results = results.replace(old, new)
    for line in results.splitlines():
        if line.startswith("program = "):
            program = (folder / line.split('"')[1]).read_text()
        if line.startswith("override_percent = "):
            override = int(line.split("=")[1]) / 100.0
        out.append(line.replace(marker, value(program, override)) if marker in line else line)
    (folder / "RESULTS.toml").write_text("\n".join(out) + "\n")


def fill_in_logs(
    folder: Path, hidden: Hidden, rng: np.random.Generator, *, hold: bool = True, actual: bool = True
) -> None:
    """Play every log test and put its record beside RESULTS.toml."""
    name, program = "", ""
    for line in (folder / "RESULTS.toml").read_text().splitlines():
        if line.startswith("[tests."):
            name = line.split("]")[0].removeprefix("[tests.")
        elif line.startswith("program = "):
            program = (folder / line.split('"')[1]).read_text()
        elif line.startswith("log = "):
            write_csv(folder / f"{name}.csv", servo_log(program, hidden, rng, hold=hold, actual=actual))


def controllers(seeds: Sequence[int]) -> list[tuple[int, Hidden, np.random.Generator]]:
    out = []
    for seed in seeds:
        rng = np.random.default_rng(seed)
        out.append((seed, draw(rng), rng))
    return out
