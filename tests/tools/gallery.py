"""The gallery of the book: every picture that a command draws, with that command: `gallery.py FOLDER`.

The commands run in an empty folder, in which the repository's programs and measured data lie. What only a machine can
give (taps, records of test cuts) is made as the tests make it. Done anew only where the package changed.
"""

from __future__ import annotations

import contextlib
import hashlib
import io
import os
import shlex
import shutil
import sys
import tempfile
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

ROOT = Path(__file__).resolve().parents[2]
sys.path[:0] = [str(ROOT / "tests" / name) for name in ("python", "oracles", "tools")]

DATA = ROOT / "python" / "shapegcode" / "data"
FILES = {
    "path.nc": DATA / "paper_path.nc",
    "part.nc": DATA / "iso10791_7.nc",
    "moulds.nc": ROOT / "tests" / "golden" / "programs" / "PARALLEL.NC",
    "pocket.nc": ROOT / "tests" / "golden" / "feed" / "POCKET.NC",
    "tool.toml": ROOT / "tests" / "golden" / "feed" / "pocket_tool.toml",
    "block.toml": ROOT / "tests" / "golden" / "feed" / "pocket_stock.toml",
    "COVER.NC": DATA / "measured" / "nist" / "programs" / "COVER.NC",
    "COVER-run1.txt.gz": DATA / "measured" / "nist" / "logs" / "COVER-run1.txt.gz",
    "COVER-run2.txt.gz": DATA / "measured" / "nist" / "logs" / "COVER-run2.txt.gz",
    "STUDY.toml": ROOT / "tests" / "golden" / "study" / "STUDY.toml",
    "capture.json.gz": DATA / "measured" / "sinumerik" / "capture.json.gz",
}


@dataclass(frozen=True)
class Entry:
    """A command and its pictures."""

    title: str  # heading
    command: str  # as one types it, without the folder of the pictures
    shown: dict[str, str]  # what each picture answers, by the name of its file
    folder: str  # of the pictures


ENTRIES = (
    Entry(
        "Before and after", "convert path.nc -m vx500 -o shaped.nc",
        {
            "path": "How far, and to which side, does the table leave the path? Drawn larger, as the title says.",
            "vibration": "How much does each axis vibrate about its command, and what is left after the stop (dashed)?",
            "feed": "How fast does the command go, along the path and per axis?",
            "tolerance": "What does a tighter contour cost in time, and where is the knee?",
        }, "convert",
    ),
    Entry(
        "A long program, where it is worst", "convert moulds.nc -m vx500 --shape-all -o quiet.nc",
        {"path": "Three seconds around the position where the original is worst; right: where that is."}, "long",
    ),
    Entry(
        "The motion of each axis", "simulate path.nc -m vx500 --plant feed-drive --lines 8-10",
        {"motion": "Position, speed, acceleration, lag and force behind motor, screw and friction."}, "simulate",
    ),
    Entry(
        "Where the time goes", "time part.nc -m vx500",
        {"time": "By tool, and in the cuts that take longest."}, "time",
    ),
    Entry(
        "The part, measured before it is cut", "measure path.nc shaped.nc -m vx500 --tool-diameter 3mm",
        {
            "measure-part": "The slot from above: nominal walls, and those that come out, magnified.",
            "measure-walls": "The same along the path: left wall, right wall, width.",
        }, "measure",
    ),
    Entry(
        "Shapers side by side", "shaper --mode 46:0.02±5% --mode 131:0.02",
        {
            "shaper-pareto": "What does less vibration cost? Each mark is a design; filled: nothing is better in both.",
            "shaper-sensitivity": "What is left if the machine's frequency is not the one in the file?",
            "shaper-impulses": "The impulses: how each shaper splits a change of speed.",
            "shaper-steps": "What becomes of a step, and how the modes follow.",
            "shaper-branches": "How long the shortest shapers of two modes are if the faster mode differs.",
        }, "shaper",
    ),
    Entry(
        "A tap test", "identify tap1.csv tap2.csv tap3.csv",
        {
            "identify-traces": "Hammer and response over time, with the fitted model's.",
            "identify-response": "Frequency response and coherence, measured and fitted.",
            "identify-stabilisation": "Poles by the order of the model: a mode stays where it is, noise wanders.",
            "identify-decay": "The decay of each mode, measured and fitted.",
        }, "tap",
    ),
    Entry(
        "A decay after a rapid stop", "identify stop.csv --axis y",
        {"identify-spectrum": "The spectrum of the decay with its peaks."}, "stop",
    ),
    Entry(
        "A resonance sweep of Klipper", "identify raw_data_x.csv",
        {"identify-sweep": "Amplitude over the frequency of the sweep, measured and fitted."}, "sweep",
    ),
    Entry(
        "Feeds by force", "feed pocket.nc -m vx500 --tool tool.toml --stock block.toml -o fast.nc",
        {
            "feed-path": "Where is the force large? Red: above the limit.",
            "feed-along-path": "What the tool meets, how fast it goes, the load on the tool.",
            "feed-surface": "How far the wall is off. Red: left standing; blue: cut too far.",
        }, "feed",
    ),
    Entry(
        "Test cuts: a taper", "testcut fit taper0.csv taper1.csv taper2.csv --cut taper/CUT.json",
        {
            "testcut-forces": "Mean forces over the radial depth, measured and fitted.",
            "testcut-coefficients": "The coefficients over the chip thickness, with what was known before.",
        }, "taper",
    ),
    Entry(
        "Test cuts: a corner", "testcut fit corner0.csv corner1.csv --cut corner/CUT.json",
        {"testcut-corner": "Resultant with constant and with lowered feed, measured and expected."}, "corner",
    ),
    Entry(
        "Test cuts: which interval the control follows",
        "testcut fit interval0.csv interval1.csv interval2.csv --cut interval/CUT.json",
        {"testcut-interval": "Force over time for each interval, and with the lag that fits best."}, "interval",
    ),
    Entry(
        "Sampled machines", "study STUDY.toml",
        {
            "study-tornado": "Which parameter decides whether the part is good?",
            "study-bands": "Residual over the parameter that decides, and within which band.",
        }, "studies",
    ),
    Entry(
        "Settings that keep the tolerance on most machines", "optimize STUDY.toml",
        {"optimum-choices": "Which choices are the fastest, and how often is each within tolerance?"}, "optimum",
    ),
    Entry(
        "Position loops identified from a log", "characterize --servo capture.json.gz -m vx500",
        {"servo": "The control's own deviation, and what our model leaves of it where it was not fitted."}, "servo",
    ),
    Entry(
        "A cycle-time model calibrated from run logs",
        "characterize --runs RUNS.toml -m vx500",
        {"clock": "Predicted over measured time of each run: whole, by tool, by kind of motion."},
        "clock",
    ),
)  # fmt: skip
KEPT = (
    ("Two machining centres predicted", "python tests/benchmarks/evidence_nist.py --plots plots", "evidence-nist.png",
     "Predicted over measured time of runs that were left out; some 100 s of CPU, so it is kept."),
    ("Error by the number of runs in the calibration", "python tests/benchmarks/evidence_nist.py --curve --plots plots",
     "evidence-nist-runs.png", "Ten minutes of CPU."),
)  # fmt: skip


def page() -> str:
    """The page, as Markdown; its pictures stand beside it."""
    parts = ["# Gallery\n\nEvery picture is drawn by a command with `--plots DIR`, as PNG and SVG, or in Python by"]
    parts[0] += " `result.plot(NAME)`\ninto axes of your own. These were drawn when this page was built.\n"
    for entry in ENTRIES:
        parts.append(f"## {entry.title}\n\n    shapegcode {entry.command} --plots plots\n")
        for name, caption in entry.shown.items():
            parts.append(f"`{name}`: {caption}\n\n![{caption}]({entry.folder}/{name}.png)\n")
    for title, command, name, caption in KEPT:
        parts.append(f"## {title}\n\n    {command}\n\n{caption}\n\n![{title}](../images/{name})\n")
    return "\n".join(parts)


def draw(place: Path) -> None:
    """Run every command, and put its pictures below a folder."""
    from shapegcode.cli import main

    with tempfile.TemporaryDirectory() as folder, contextlib.chdir(folder):
        for name, file in FILES.items():
            shutil.copy(file, name)
        _measured()
        for entry in ENTRIES:
            said = io.StringIO()
            words = [*shlex.split(entry.command), "--plots", "plots-" + entry.folder]
            with contextlib.redirect_stdout(said), contextlib.redirect_stderr(said):
                code = main(words)
            if code == 2:
                raise SystemExit(f"{entry.command}: exit code 2\n{said.getvalue()}")
            (place / entry.folder).mkdir(parents=True, exist_ok=True)
            for name in entry.shown:
                shutil.copy(Path("plots-" + entry.folder) / f"{name}.png", place / entry.folder)


def _measured() -> None:
    """Records that a machine would give."""
    import numpy as np

    import test_identify_command as taps
    import test_sweep as sweeps
    import test_test_cuts as cuts

    Path("RUNS.toml").write_text(
        '[[runs]]\nprogram = "COVER.NC"\nlogs = ["COVER-run1.txt.gz", "COVER-run2.txt.gz"]\n', encoding="utf-8"
    )
    for seed in (1, 2, 3):
        taps.write_tap(Path(f"tap{seed}.csv"), seed=seed, samples=2048)
    taps.write_stop(Path("stop.csv"))
    sweeps.save(Path("raw_data_x.csv"), *sweeps.shaken([(0.7, 55.0, 0.04), (0.3, 92.0, 0.03)]))
    kinds = (
        ("taper", ("--length", "40", "-F", "216,432,864"), lambda _side: cuts.taper_edge, 0.0, 1013.0),
        ("corner", (), cuts.corner_edge, 0.0, 1013.0),
        ("interval", (), lambda _side: lambda x: np.full(len(x), 0.8), 0.1, 2219.0),
    )
    for kind, options, edge_of, lag_s, rate in kinds:
        Path(kind).mkdir()
        with contextlib.redirect_stdout(io.StringIO()):
            side = cuts.write(Path(kind), kind, *options)
        for number, each in enumerate(side["passes"]):
            time, _, force = cuts.simulated(each, edge_of(side), rate=rate, noise=0.03, lag_s=lag_s, seed=number)
            cuts.saved(Path(f"{kind}{number}.csv"), time_s=time, fx_n=force[:, 0], fy_n=force[:, 1])


def sources() -> Iterator[Path]:
    """What the pictures depend on."""
    yield Path(__file__)
    for folder in ("python/shapegcode", "tests/golden/feed"):
        files = (ROOT / folder).rglob("*")
        yield from sorted(file for file in files if file.suffix in {".py", ".so", ".toml", ".NC", ".nc"})


if __name__ == "__main__":
    place = Path(sys.argv[1]).resolve()
    mark = hashlib.sha256(b"".join(file.read_bytes() for file in sources())).hexdigest()
    stamp = place / "drawn"
    if not stamp.is_file() or stamp.read_text(encoding="utf-8") != mark:
        os.environ["NO_COLOR"] = "1"
        draw(place)
        stamp.write_text(mark, encoding="utf-8")
