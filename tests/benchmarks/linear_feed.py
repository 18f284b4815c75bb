"""Figures of docs/howto/control_siemens.md: `python tests/benchmarks/linear_feed.py`.

Converts programs for a Sinumerik with blocks of constant feed and with FLIN, reads both texts with a reader of its own,
integrates the feeds with SciPy, and prints blocks, bytes, differences of the commands and residual vibration.
"""

from __future__ import annotations

import re
from dataclasses import replace

import numpy as np
from places import GOLDEN, ROOT

import shapegcode as sg
from judge import Mode, residual_um
from linear_feed_reader import FeedBlock, command, cuts_with_flin
from shapegcode.machine.programs import ANY_PRICE

PROGRAMS = {
    "paper's path": (ROOT / "python/shapegcode/data/paper_path.nc").read_text(),
    "CONTOUR_R at F6000": re.sub(r"F\d+\.0", "F6000.", (GOLDEN / "CONTOUR_R.NC").read_text()),
    "VINT_360arc at F6000": (GOLDEN / "VINT_360arc.NC").read_text().replace("F250", "F6000"),
}
MODES = [[Mode(46.0, 0.02)], [Mode(131.0, 0.02)], []]
TICK_S = 0.001


def converted(text: str, form: str) -> sg.Conversion:
    """For the machine of paper 000, whose table has modes at 46 and 131 Hz."""
    keys = {
        **ANY_PRICE,
        "axes.x.modes": [{"frequency_hz": 46.0, "damping_ratio": 0.02}],
        "axes.y.modes": [{"frequency_hz": 131.0, "damping_ratio": 0.02}],
        "axes.z.rigid": True,
        "emission.dialect": "siemens",
        "emission.words": {"G28": "", "G43": "D1", "G49": "", "M01": ""},
        "emission.feed_form": form,
    }
    return sg.convert(text, sg.Machine.of("kimm004").with_values(keys), shape_all=True)


def residual(cuts: list[list[FeedBlock]]) -> list[float]:
    """Largest residual vibration of all cuts in X and Y, µm."""
    found = [residual_um(command(cut, TICK_S), MODES, TICK_S)[:2] for cut in cuts]
    return [float(value) for value in np.max(found, axis=0)]


def on_ticks(cuts: list[list[FeedBlock]], period_s: float) -> list[list[FeedBlock]]:
    """Blocks of constant feed that last the whole periods for which their F was rounded up."""
    found = []
    for cut in cuts:
        periods = [max(1, round(block.length / block.feed * 60.0 / period_s)) for block in cut]
        feeds = [block.length / (count * period_s) * 60.0 for block, count in zip(cut, periods, strict=True)]
        found.append([replace(block, before=feed, feed=feed) for block, feed in zip(cut, feeds, strict=True)])
    return found


def difference_um(one: list[list[FeedBlock]], other: list[list[FeedBlock]], tick_s: float) -> float:
    """Largest distance of two commands at the ticks of a clock, µm."""
    largest = 0.0
    for a, b in zip(one, other, strict=True):
        first, second = command(a, tick_s), command(b, tick_s)
        count = min(len(first), len(second))
        largest = max(largest, float(np.linalg.norm(first[:count] - second[:count], axis=1).max()))
    return largest * 1e3


def main() -> None:
    """Print a row for each program and form."""
    print("| program | feed | blocks | bytes | residual X/Y um | difference at ends of periods, anywhere um |")
    print("|---|---|---|---|---|---|")
    for name, text in PROGRAMS.items():
        forms = {form: converted(text, form) for form in ("constant", "linear")}
        cuts = {form: cuts_with_flin(conversion.text.decode()) for form, conversion in forms.items()}
        period_s = forms["constant"].block_period_s
        for form, conversion in forms.items():
            blocks = sum(map(len, cuts[form]))
            x, y = residual(cuts[form])
            gap = ""
            if form == "linear":
                ends, anywhere = (
                    difference_um(on_ticks(cuts["constant"], period_s), cuts[form], tick)
                    for tick in (period_s, TICK_S / 4.0)
                )
                gap = f"{ends:.2f}, {anywhere:.1f}"
            print(f"| {name} | {form} | {blocks} | {len(conversion.text)} | {x:.2f}/{y:.2f} | {gap} |")


if __name__ == "__main__":
    main()
