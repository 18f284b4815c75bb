"""Set-points of moves as Klipper's look-ahead plans them: a task as JSON on stdin, points as a file, seconds on stdout.

It runs in the environment of tests/tools/fetch_peers.sh, beside klipper_moves.py; the look-ahead is that of peers.py.
"""

from __future__ import annotations

import json
import sys
from pathlib import Path

import numpy as np

sys.path.append(str(Path(__file__).resolve().parents[1] / "benchmarks"))

import peer_klipper


def main() -> None:
    asked = json.load(sys.stdin)
    moves, _, _ = peer_klipper.plan(asked["path"], asked["limits"])
    np.save(asked["file"], peer_klipper.set_points(moves, asked["period_s"]))
    print(sum(move.accel_t + move.cruise_t + move.decel_t for move in moves))


if __name__ == "__main__":
    main()
