"""The sample programs, and how they are meant to be read."""

from __future__ import annotations

from pathlib import Path
from typing import Literal

PROGRAMS = Path(__file__).parents[2] / "golden" / "programs"
SAMPLES = sorted(p.name for p in PROGRAMS.iterdir() if p.suffix.lower() == ".nc")


def read_sample(name: str) -> str:
    return (PROGRAMS / name).read_bytes().decode("ascii")


def centre_of(name: str) -> Literal["incremental", "absolute"]:
    return "absolute" if name == "BOTTLE.NC" else "incremental"
