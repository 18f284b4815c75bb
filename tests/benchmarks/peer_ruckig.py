"""Moves of Ruckig's free version, for peers.py: tasks as JSON on stdin, set-points as files, times as JSON on stdout.

It runs in an environment of its own (tests/tools/fetch_peers.sh) and imports nothing of this package.
"""

from __future__ import annotations

import importlib.metadata
import json
import sys
import time
from typing import Any

import numpy as np
import ruckig


def main() -> None:
    """Run every move from rest to rest, set-point by set-point."""
    asked = json.load(sys.stdin)
    moves = [run(move, asked["period_s"], asked["passes"]) for move in asked["moves"]]
    json.dump({"version": importlib.metadata.version("ruckig"), "moves": moves}, sys.stdout)


def run(move: dict[str, Any], period_s: float, passes: int) -> dict[str, float]:
    """One move; the least of the passes counts, as of a step of ours."""
    axes = len(move["target"])
    wanted = ruckig.InputParameter(axes)
    wanted.current_position = [0.0] * axes
    wanted.target_position = move["target"]
    wanted.max_velocity, wanted.max_acceleration, wanted.max_jerk = move["feed"], move["acceleration"], move["jerk"]
    wanted.synchronization = getattr(ruckig.Synchronization, move["synchronization"])
    calculation_us: list[float] = []
    steps_us: list[list[float]] = []
    for _ in range(passes):
        generator, given = ruckig.Ruckig(axes, period_s), ruckig.OutputParameter(axes)
        points, spent = [list(wanted.current_position)], []
        while True:
            begin = time.perf_counter()
            result = generator.update(wanted, given)
            spent.append(1e6 * (time.perf_counter() - begin))
            if len(spent) == 1:
                calculation_us.append(given.calculation_duration)
            points.append(list(given.new_position))
            if result != ruckig.Result.Working:
                break
            given.pass_to_input(wanted)
        if result != ruckig.Result.Finished:
            raise RuntimeError(f"Ruckig ended with {result}")
        wanted.current_position = [0.0] * axes
        wanted.current_velocity = wanted.current_acceleration = [0.0] * axes
        steps_us.append(spent)
    np.array(points).tofile(move["file"])
    least = np.array(steps_us).min(axis=0)
    return {
        "duration_s": given.trajectory.duration,
        "calculation_us": min(calculation_us),
        "step_us": float(least.mean()),
        "longest_step_us": float(least.max()),
    }


if __name__ == "__main__":
    main()
