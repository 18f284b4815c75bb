"""Whose modes an axis keeps: options and a question, because modes of another machine are never taken in silence."""

from __future__ import annotations

import argparse
import sys
from collections.abc import Mapping

from shapegcode.cli import typed


def add_modes_arguments(parser: argparse.ArgumentParser, keep: str) -> None:
    """Declare what decides over modes that were not measured on this machine."""
    parser.add_argument(
        keep,
        dest="keep_modes",
        metavar="AXES",
        type=typed.axes,
        default=None,
        help="keep the modes of these axes, for example XY, though they were not measured here: it is the same machine",
    )
    parser.add_argument(
        "--rigid",
        metavar="AXES",
        type=typed.axes,
        default=None,
        help="these axes have no vibration mode that counts, for example Z",
    )


def decided_modes(args: argparse.Namespace, open_modes: Mapping[str, str], said: str) -> tuple[str, str]:
    """What the options say, and at a terminal the answers to a question for each axis that they leave open."""
    keep, rigid = args.keep_modes or "", args.rigid or ""
    if not (sys.stdin.isatty() and sys.stderr.isatty()):
        return keep, rigid
    for axis, modes in open_modes.items():
        if axis in keep or axis in rigid:
            continue
        question = f"{said} {axis.upper()} has {modes}: [k]eep, [r]igid, or leave [o]pen? "
        print(question, end="", file=sys.stderr, flush=True)
        answer = sys.stdin.readline().strip().lower()[:1]
        keep += axis if answer == "k" else ""
        rigid += axis if answer == "r" else ""
    return keep, rigid
