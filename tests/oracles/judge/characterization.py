"""Draws controllers, lets them play written test programs, and compares what is fitted with what was hidden."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
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

    results = (folder / "RESULTS.toml").read_text()
    results = results.replace("reaction_s = 0.1", f"reaction_s = {jitter_s}")
    program, override, out = "", 1.0, []
    for line in results.replace("resolution_s = 0.1", f"resolution_s = {resolution_s}").splitlines():
        if line.startswith("program = "):
            program = (folder / line.split('"')[1]).read_text()
        if line.startswith("override_percent = "):
            override = int(line.split("=")[1]) / 100.0
        if "times_s = []" in line:
            time = stopwatch_s(program, hidden, rng, override=override, resolution_s=resolution_s, jitter_s=jitter_s)
            out.append(line.replace("times_s = []", f"times_s = [{time:.6g}]"))
        else:
            out.append(line)
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


def controllers(seeds: Sequence[int]) -> Iterator[tuple[int, Hidden, np.random.Generator]]:
    for seed in seeds:
        rng = np.random.default_rng(seed)
        yield seed, draw(rng), rng
