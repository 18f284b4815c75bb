"""Two machining centres of NIST's test bed: their clocks learned from logs, and programs left out predicted."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from importlib import resources
from pathlib import Path
from typing import Any, ClassVar

from shapegcode.demos.result import Demonstration, Statement, compared, stated
from shapegcode.machine import Machine
from shapegcode.results.json import hidden
from shapegcode.results.table import Column, Table
from shapegcode.timing.calibration.calibrate import learn_clock
from shapegcode.timing.calibration.result import TOLERANCE_PERCENT, LearnedClock, LearnedRun, LearnedShare
from shapegcode.timing.calibration.runs_file import RunEntry, RunsFile

__all__ = [
    "STUDIES",
    "TOOL_PERCENT",
    "EvidenceDemo",
    "Study",
    "evidence_demo",
    "nist_folder",
    "nist_runs",
    "statements",
    "study_of",
]

TOOL_PERCENT = 5.0
"""Within which a tool's share, or that of a kind of motion, agrees."""

STUDIES = (
    ("BOX OP2 → OP3", ("BOX_OP2",), "BOX_OP3"),
    ("BOX OP3 → OP2", ("BOX_OP3",), "BOX_OP2"),
    ("COVER, PLATE-12 → PLATE-13", ("COVER", "PLATE-12"), "PLATE-13"),
)
"""Title, programs that are learned from, and the one that is left out."""

_MACHINE = "vx500"
_REMARK = (
    "measured: by the log; predicted: by a machine that was learned from other programs. Whole runs agree within "
    f"{TOLERANCE_PERCENT:g} %, shares within {TOOL_PERCENT:g} %; of a tool the run is shown in which it is furthest "
    "off. Overrides are those of each run, as its log shows them; a run that was held is not counted."
)


@dataclass(frozen=True)
class Study:
    """One machine learned from some programs, and another program predicted.

    Attributes:
        title: which programs.
        family: kind of look-ahead that was chosen.
        learned_runs: runs that were learned from.
        not_told: what the logs cannot tell, in words.
        runs: all of them, those left out have use "test".
        fitted: the machine with what was learned.
    """

    title: str
    family: str
    learned_runs: int
    not_told: tuple[str, ...]
    runs: tuple[LearnedRun, ...]
    fitted: Machine = field(metadata=hidden())

    @property
    def left_out(self) -> tuple[LearnedRun, ...]:
        """Runs of the program that was not learned from, whole and without holds."""
        return tuple(run for run in self.runs if run.use == "test" and run.measured_s is not None and not run.held_s)

    @property
    def largest_error_percent(self) -> float:
        """Of a run left out."""
        return max((abs(run.error_percent or 0.0) for run in self.left_out), default=0.0)

    @property
    def shares(self) -> Mapping[str, tuple[LearnedShare, str]]:
        """Of each tool and kind of motion the share that is furthest off, and the run that it is of."""
        found: dict[str, tuple[LearnedShare, str]] = {}
        for run in self.left_out:
            for share in (*run.tools, *run.kinds):
                if share.name not in found or abs(share.error_percent) > abs(found[share.name][0].error_percent):
                    found[share.name] = share, run.name
        return found


@dataclass(frozen=True, repr=False, kw_only=True)
class EvidenceDemo(Demonstration):
    """Runs left out, predicted beside measured.

    Attributes:
        studies: what was learned from which programs, with every run.
    """

    json_extra: ClassVar[dict[str, Any]] = {
        **Demonstration.json_extra,
        "largest_error_percent": float,
        "largest_tool_error_percent": float,
    }

    studies: tuple[Study, ...]

    @property
    def largest_error_percent(self) -> float:
        """Of a whole run left out."""
        return max((study.largest_error_percent for study in self.studies), default=0.0)

    @property
    def largest_tool_error_percent(self) -> float:
        """Of a tool's share of a run left out."""
        tools = [share for study in self.studies for run in study.left_out for share in run.tools]
        return max((abs(share.error_percent) for share in tools), default=0.0)

    @property
    def answer(self) -> str:
        """How far predictions are off."""
        agree = sum(row.agreement == "agrees" for row in self.rows)
        counted = sum(row.agreement != "open" for row in self.rows)
        return (
            f"{self.title}: {agree} of {counted} figures agree with {self.paper}; runs left out are at most "
            f"{self.largest_error_percent:.1f} % off, their tools {self.largest_tool_error_percent:.1f} %"
        )

    @property
    def next_step(self) -> str:
        """The one thing to do next."""
        return "shapegcode characterize --runs RUNS.toml -m YOUR_MACHINE.toml with logs of your machine"

    def tables(self) -> list[Table]:
        """Predicted beside measured, and what was learned."""
        columns = (
            Column("learned → left out", value="place", text=True),
            Column("what", text=True),
            Column("measured", value="published", left=True),
            Column("predicted", value="ours", left=True),
            Column("error", "%", "difference_percent", digits=2),
            Column("agrees", value=lambda row: {"agrees": "yes", "differs": "NO"}.get(row.agreement, "")),
            Column("note", text=True),
        )
        learned = (
            Column("study", value="title", text=True),
            Column("runs", value="learned_runs"),
            Column("look-ahead", value="family", text=True),
            Column("not told by the logs", value=lambda study: len(study.not_told)),
        )
        return [Table("", columns, self.rows, caption=self.remark), Table("learned", learned, self.studies)]


def nist_folder() -> Path:
    """Folder of the programs and logs of NIST's test bed that come with shapegcode."""
    return Path(str(resources.files("shapegcode") / "data" / "measured" / "nist"))


def nist_runs(learned: Mapping[str, Sequence[int]], left_out: str) -> RunsFile:
    """Runs of the test bed as a file of runs would list them.

    Args:
        learned: numbers of the runs that are learned from, by program; none: all of it.
        left_out: program whose runs are predicted.

    Returns:
        The pairs of program and logs.
    """
    folder = nist_folder()

    def entry(program: str, numbers: Sequence[int], use: str) -> RunEntry:
        logs = sorted((folder / "logs").glob(f"{program}-run*.txt.gz"))
        if numbers:
            logs = [folder / "logs" / f"{program}-run{number}.txt.gz" for number in numbers]
        return RunEntry(folder / "programs" / f"{program}.NC", tuple(logs), "test" if use == "test" else "fit")

    entries = [entry(program, numbers, "fit") for program, numbers in learned.items()]
    return RunsFile(folder, (*entries, entry(left_out, (), "test")))


def study_of(title: str, found: LearnedClock) -> Study:
    """What a demonstration keeps of a learned machine.

    Args:
        title: of the study.
        found: what was learned, with runs that are only predicted.

    Returns:
        Its runs, with the names of their files alone.
    """
    runs = tuple(replace(run, program=Path(run.program).name, log=Path(run.log).name) for run in found.runs)
    return Study(title, found.family, sum(run.use == "fit" for run in runs), found.not_told, runs, found.fitted)


def evidence_demo(
    on_progress: Callable[[float], None] = lambda _: None,
    *,
    studies: Sequence[tuple[str, Sequence[str], str]] = STUDIES,
    families: Sequence[str] | None = None,
) -> EvidenceDemo:
    """Learn two machining centres from logs, and predict the programs that were left out.

    Args:
        on_progress: called with the share of the work done, 0 to 1.
        studies: title, programs that are learned from, and the one that is left out.
        families: kinds of look-ahead that are tried; None: all.

    Returns:
        Every run left out beside what was predicted: whole, by tool, by kind of motion.

    Raises:
        RecordError: a log cannot be used.
        OSError: the data are not there.

    Source: NIST Smart Manufacturing Systems Test Bed, logs of 2017.
    """
    machine = Machine.load(_MACHINE)
    found = []
    for index, (title, learned, left_out) in enumerate(studies):
        runs = nist_runs(dict.fromkeys(learned, ()), left_out)

        def progress(share: float, begun: int = index) -> None:
            on_progress((begun + share) / len(studies))

        found.append(study_of(title, learn_clock(runs, machine, families=families, on_progress=progress)))
    return EvidenceDemo(
        paper="the logs of NIST's test bed",
        title="Programs left out, by learned machines",
        rows=tuple(row for study in found for row in statements(study)),
        remark=_REMARK,
        warnings=tuple(
            f"{study.title}: {run.name} was held for {run.held_s:.1f} s and is not counted"
            for study in found
            for run in study.runs
            if run.use == "test" and run.held_s
        ),
        studies=tuple(found),
    )


def statements(study: Study) -> list[Statement]:
    """Runs that were left out, whole, by tool and by kind of motion, beside what was predicted.

    Args:
        study: what was learned from which programs.

    Returns:
        A row for each, with its verdict.
    """
    rows = []
    for run in study.left_out:
        took = run.measured_s or 0.0
        interval = f"95 %: {run.low_s:.1f} ... {run.high_s:.1f} s, {'holds' if _holds(run) else 'does NOT hold'} it"
        rows.append(
            compared(
                study.title, run.log.split(".")[0], took, run.predicted_s, "s",
                digits=1, within=0.01 * TOLERANCE_PERCENT * took, note=interval,
            )
        )  # fmt: skip
    for name, (share, run_name) in study.shares.items():
        rows.append(
            compared(
                study.title, name, share.measured_s, share.predicted_s, "s", digits=1,
                within=0.01 * TOOL_PERCENT * share.measured_s, note=f"in {run_name.split(', ')[1].split('.')[0]}",
            )
        )  # fmt: skip
    held, count = sum(_holds(run) for run in study.left_out), len(study.left_out)
    rows.append(
        stated(study.title, "95 % intervals hold the time", f"{count} of {count}", f"{held} of {count}", held == count)
    )
    return rows


def _holds(run: LearnedRun) -> bool:
    return run.measured_s is not None and run.low_s <= run.measured_s <= run.high_s
