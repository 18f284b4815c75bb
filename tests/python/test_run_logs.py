"""Logs of runs: what is read of them, what is bridged and said, what is refused."""

import csv
import gzip
import re
import tracemalloc
from collections.abc import Mapping
from datetime import datetime
from pathlib import Path

import numpy as np
import pytest

import shapegcode as sg

NIST = Path(__file__).resolve().parents[2] / "python" / "shapegcode" / "data" / "measured" / "nist"

LOG = """\
2026-03-02T08:00:00.0000000Z|Current_Tool|4.000000
2026-03-02T08:00:01.0000000Z|Feed_Override|100.000000
2026-03-02T08:09:59.9000000Z|Block_Number|1
2026-03-02T08:10:00.0000000Z|Program_Status|ACTIVE
2026-03-02T08:10:00.1000000Z|Program_Name_Running|PLATE.NC
2026-03-02T08:10:00.5000000Z|Block_Number|7
2026-03-02T08:10:00.6000000Z|Feed_Rate|16.9333
2026-03-02T08:10:02.0000000Z|Block_Number|8
2026-03-02T08:10:02.5000000Z|Program_Runtime_Seconds|5
2026-03-02T08:10:03.0000000Z|Current_Tool|0
2026-03-02T08:10:04.0000000Z|Current_Tool|5
2026-03-02T08:10:05.0000000Z|Block_Number|12
2026-03-02T08:10:06.2500000Z|Program_Status|PROGRAM_COMPLETED
2026-03-02T08:10:07.0000000Z|Block_Number|0
"""


def written(folder: Path, text: str, name: str = "run.txt") -> Path:
    path = folder / name
    path.write_text(text, encoding="utf-8")
    return path


def read(
    folder: Path, text: str, name: str = "run.txt", items: Mapping[str, str] | None = None
) -> tuple[sg.RunLog, ...]:
    return sg.read_run_logs(written(folder, text, name), items=items)


def only(folder: Path, text: str, name: str = "run.txt") -> sg.RunLog:
    (run,) = read(folder, text, name)
    return run


def refused(folder: Path, text: str | bytes, message: str, name: str = "run.txt") -> None:
    path = folder / name
    path.write_bytes(text if isinstance(text, bytes) else text.encode())
    with pytest.raises(sg.RecordError) as error:
        sg.read_run_logs(path)
    assert re.search(message, str(error.value)), error.value


def values(signal: sg.Signal | None) -> list[tuple[float, float]]:
    return [(round(float(time), 6), float(value)) for time, value in zip(signal.time_s, signal.value, strict=True)]


# --- NIST's logs against what was published of them ------------------------------------------------------------------


def published() -> dict[str, float]:
    with (NIST / "runs.csv").open(encoding="utf-8") as file:
        return {row["start_utc"]: float(row["active_to_completed_s"]) for row in csv.DictReader(file)}


@pytest.mark.parametrize("path", sorted((NIST / "logs").iterdir()), ids=lambda path: path.name)
def test_runs_of_nist(path: Path) -> None:
    (run,) = sg.read_run_logs(path)
    assert run.complete
    assert run.duration_s == pytest.approx(published()[run.start], abs=0.006)  # published to .01
    program = NIST / "programs" / (path.name.partition("-run")[0] + ".NC")
    lines = program.read_text(encoding="latin-1").count("\n") + 1
    assert 0 <= run.block.value.min() < 13
    assert lines - 10 < run.block.value.max() <= lines
    assert np.all(np.diff(run.block.time_s) > 0.0)
    assert run.feed is not None and run.feed_unit is None
    assert run.block_counts == "line"


def test_values_of_nist_are_those_of_the_lines() -> None:
    """A second reading that shares nothing with the first: every line by Python's own datetime."""
    path = NIST / "logs" / "PLATE-13-run1.txt.gz"
    rows = [line.split("|") for line in gzip.decompress(path.read_bytes()).decode("ascii").splitlines()]
    when = [datetime.fromisoformat(row[0][:26] + "+00:00").timestamp() for row in rows]
    (start,) = (time for time, row in zip(when, rows, strict=True) if row[2] == "ACTIVE")
    (end,) = (time for time, row in zip(when, rows, strict=True) if row[2] == "PROGRAM_COMPLETED")
    (run,) = sg.read_run_logs(path)
    for item, signal in {"Feed_Rate": run.feed, "Current_Tool": run.tool, "Spindle_Speed": run.spindle_rpm}.items():
        expected = [
            (time - start, float(row[2]))
            for time, row in zip(when, rows, strict=True)
            if row[1] == item and start - 1.0 <= time <= end
        ]
        np.testing.assert_allclose(signal.time_s, [time for time, _ in expected], atol=2e-6)
        np.testing.assert_array_equal(signal.value, [value for _, value in expected])
    assert run.program == "NIST_MTC_CRADA_PLATE-13.NC"
    assert run.notes == ("line 3192: Block_Number is empty, ignored",)
    assert rows[3191][1:] == ["Block_Number", ""]


def test_an_override_that_was_moved_is_read_as_a_ratio_and_what_held_before_is_said() -> None:
    (run,) = sg.read_run_logs(NIST / "logs" / "BOX_OP2-run2.txt.gz")
    assert run.feed_override is not None and run.rapid_override is not None
    assert run.feed_override.value[0] == 1.07
    assert run.rapid_override.value.min() == 0.0
    assert "Feed_Override is first logged at 1.89 s: the value before is unknown" in run.notes


# --- SHDR -------------------------------------------------------------------------------------------------------------


def test_a_run_by_hand(tmp_path: Path) -> None:
    run = only(tmp_path, LOG)
    assert (run.start, run.duration_s, run.ended_by) == ("2026-03-02T08:10:00.0000000Z", 6.25, "PROGRAM_COMPLETED")
    assert run.lines == (4, 13)
    assert values(run.block) == [(-0.1, 1), (0.5, 7), (2.0, 8), (5.0, 12)]
    assert values(run.feed) == [(0.6, 16.9333)]
    # Ten minutes before the start the tool was set: it still holds.
    assert values(run.tool) == [(0.0, 4), (3.0, 0), (4.0, 5)]
    assert values(run.feed_override) == [(0.0, 1.0)]
    assert run.rapid_override is None and run.spindle_rpm is None
    assert (run.program, run.holds, run.gaps, run.notes) == ("PLATE.NC", (), (), ())


@pytest.mark.parametrize("ending", ["\n", "\r\n"])
def test_several_items_in_a_line_and_what_is_no_item(tmp_path: Path, ending: str) -> None:
    text = ending.join(
        [
            "* adapterVersion: 1.0",
            "2026-03-02T08:10:00.000Z@0.1|execution|ACTIVE|line|7|path_feedrate|120.5",
            "2026-03-02T08:10:01.000Z|system|FAULT|1203|HIGH||spindle is hot",
            "2026-03-02T08:10:01.000Z|system|normal||||",
            "2026-03-02T08:10:01.500Z|message|M12|change the insert",
            "2026-03-02T08:10:02.000Z|@ASSET@|T1|CuttingTool|--multiline--AB12",
            "<CuttingTool>2026|line|99</CuttingTool>",
            "--multiline--AB12",
            "2026-03-02T08:10:03.000Z|M1:line|UNAVAILABLE|tool_id|4",
            "2026-03-02T08:10:04.000Z|line|9",
            "2026-03-02T08:10:05.000Z|execution|PROGRAM_COMPLETED",
        ]
    )
    run = only(tmp_path, text)
    assert values(run.block) == [(0.0, 7), (4.0, 9)]
    assert values(run.feed) == [(0.0, 120.5)]
    assert values(run.tool) == [(3.0, 4)]
    assert run.duration_s == 5.0
    assert set(run.notes) == {
        "line 3: the condition system, ignored",
        "line 4: the condition system, ignored",
        "line 5: '2026-03-02T08:10:01.500Z|message|M12|change the insert' is not time|item|value, ignored",
        "line 6: an asset, ignored",
        "line 9: M1:line is 'UNAVAILABLE', no line number, ignored",
    }


def test_names_of_items_are_known_or_given(tmp_path: Path) -> None:
    text = "\n".join(
        f"2026-03-02T08:10:{second:02}Z|{item}|{value}"
        for second, item, value in [
            (0, "Zustand", "RUNNING"), (1, "N-Zeile", 7), (1, "BLOCK NO", 70), (2, "N-Zeile", 8), (2, "BLOCK NO", 80),
            (3, "Zustand", "READY"),
        ]
    )  # fmt: skip
    (run,) = read(tmp_path, text, items={"status": "Zustand", "block": "N-Zeile"})
    assert run.block.value.tolist() == [7, 8]
    assert (run.duration_s, run.ended_by) == (3.0, "READY")
    assert any("READY without PROGRAM_COMPLETED" in note for note in run.notes)
    with pytest.raises(sg.RecordError, match=r"items: 'blok' is not known; did you mean block\?"):
        read(tmp_path, text, items={"blok": "N-Zeile"})


def test_the_better_known_of_two_items_is_taken_and_the_other_said(tmp_path: Path) -> None:
    run = only(tmp_path, LOG.replace("Program_Runtime_Seconds|5", "Line|999"))
    assert 999 not in run.block.value
    assert run.notes == ("line 4: Line ignored: Block_Number is used",)


def test_a_day_holds_several_runs_in_bounded_memory(tmp_path: Path) -> None:
    """The values between two runs count for neither, and the limit is that of one run, not of the log."""
    day = "".join(LOG.replace("T08:", f"T{hour:02}:").replace("PLATE", f"P{hour % 2}") for hour in range(5, 20))
    path = written(tmp_path, day, "day.txt")
    runs = sg.read_run_logs(path, max_values=20)
    assert [run.start[11:13] for run in runs] == [f"{hour:02}" for hour in range(5, 20)]
    assert all(values(run.block) == [(-0.1, 1), (0.5, 7), (2.0, 8), (5.0, 12)] for run in runs)
    assert len(sg.read_run_logs(path, program_name="p1.nc")) == 8
    with pytest.raises(sg.RecordError, match=r"no run of P7.NC; the log names P1.NC, P0.NC"):
        sg.read_run_logs(path, program_name="P7.NC")
    with pytest.raises(sg.RecordError, match=r"day.txt:\d+: the run that began in line 4 has more than 5 values"):
        sg.read_run_logs(path, max_values=5)


@pytest.mark.slow
def test_the_memory_is_that_of_a_run_however_long_the_log(tmp_path: Path) -> None:
    def peak(runs: int) -> int:
        lines = "".join(f"2026-03-02T08:10:04.{k:03}Z|Feed_Rate|{k}\n" for k in range(1000))
        run = LOG.replace("2026-03-02T08:10:05", lines + "2026-03-02T08:10:05")
        days = [f"{2 + k // 20:02}T{k % 20:02}:" for k in range(runs)]
        path = written(tmp_path, "".join(run.replace("02T08:", day) for day in days), "day.txt")
        tracemalloc.start()
        try:
            assert sum(len(each.block) for each in sg.iter_run_logs(path)) == 4 * runs
            return tracemalloc.get_traced_memory()[1]
        finally:
            tracemalloc.stop()

    peak(2)  # modules are loaded
    assert peak(200) < 1.2 * peak(60) < 20e6


def test_holds_are_those_of_the_log(tmp_path: Path) -> None:
    text = LOG.replace(
        "2026-03-02T08:10:03.0000000Z|Current_Tool|0",
        "2026-03-02T08:10:02.2500000Z|Program_Status|FEED_HOLD\n"
        "2026-03-02T08:10:02.7500000Z|Program_Status|ACTIVE\n"
        "2026-03-02T08:10:03.0000000Z|Program_Status|STOPPED\n"
        "2026-03-02T08:10:03.5000000Z|Program_Status|ACTIVE",
    )
    run = only(tmp_path, text)
    assert run.holds == ((2.25, 0.5), (3.0, 0.5))
    assert run.duration_s == 6.25


def test_a_program_that_begins_anew_after_a_stop_is_two_runs(tmp_path: Path) -> None:
    text = LOG.replace(
        "2026-03-02T08:10:06.2500000Z|Program_Status|PROGRAM_COMPLETED",
        "2026-03-02T08:10:05.5000000Z|Program_Status|STOPPED\n"
        "2026-03-02T08:10:20.0000000Z|Program_Status|ACTIVE\n"
        "2026-03-02T08:10:20.2500000Z|Block_Number|2\n"
        "2026-03-02T08:10:21.0000000Z|Block_Number|12\n"
        "2026-03-02T08:10:22.0000000Z|Program_Status|PROGRAM_COMPLETED",
    )
    first, second = read(tmp_path, text)
    assert (first.duration_s, first.ended_by, first.holds) == (5.5, "STOPPED", ())
    assert (second.start, second.duration_s, second.holds) == ("2026-03-02T08:10:20.0000000Z", 2.0, ())
    assert values(first.block)[-1] == (5.0, 12)
    assert values(second.block) == [(0.25, 2), (1.0, 12)]


@pytest.mark.parametrize("word", ["READY", "UNAVAILABLE"])
def test_a_run_that_ends_otherwise_is_said(tmp_path: Path, word: str) -> None:
    run = only(tmp_path, LOG.replace("PROGRAM_COMPLETED", word))
    assert run.cut_end == (word == "UNAVAILABLE")
    assert run.duration_s == (None if run.cut_end else 6.25)
    assert any(word in note for note in run.notes)


def test_a_log_that_begins_or_ends_within_a_run_says_so(tmp_path: Path) -> None:
    lines = LOG.splitlines(keepends=True)
    begun = only(tmp_path, "".join(lines[5:]))
    assert begun.cut_start and begun.duration_s is None and not begun.complete
    assert begun.notes == ("line 1: the log begins within a run: no Program_Status ACTIVE before it",)
    assert values(begun.block)[0] == (0.0, 7)
    ended = only(tmp_path, "".join(lines[:12]))
    assert ended.cut_end and ended.duration_s is None
    assert ended.notes == ("line 12: the log ends within the run",)
    late = only(tmp_path, LOG.replace("Block_Number|1\n", "Block_Number|512\n"))
    assert any("the first Block_Number is 512" in note for note in late.notes)


def test_a_clock_that_goes_back_ends_the_run_there(tmp_path: Path) -> None:
    run = only(tmp_path, LOG.replace("T08:10:05", "T07:10:05"))
    assert run.cut_end and run.duration_s is None
    assert values(run.block) == [(-0.1, 1), (0.5, 7), (2.0, 8)]
    assert run.notes == ("line 12: the clock goes back by 3599.000 s; the run ends there, its rest is ignored",)


def test_a_clock_that_goes_back_in_a_log_without_states_makes_two_runs(tmp_path: Path) -> None:
    text = "".join(line for line in LOG.splitlines(keepends=True) if "Program_Status" not in line)
    first, second = read(tmp_path, text + text)
    assert first.cut_start and first.duration_s is None and second.duration_s is None
    assert first.block.value.tolist() == second.block.value.tolist() == [1, 7, 8, 12, 0]
    assert first.notes[0] == "line 13: the clock goes back by 607.000 s; the run ends there, and another one begins"


def test_values_that_overtake_each_other_are_sorted(tmp_path: Path) -> None:
    run = only(tmp_path, LOG.replace("08:10:02.0000000Z|Block_Number|8", "08:10:00.4900000Z|Block_Number|8"))
    assert values(run.block) == [(-0.1, 1), (0.49, 8), (0.5, 7), (5.0, 12)]
    assert run.notes == ("line 8: its time stamp is 0.110 s before that of the line above; sorted",)


def test_a_silence_within_a_run_is_a_gap(tmp_path: Path) -> None:
    run = only(tmp_path, LOG.replace("T08:10:05", "T09:10:05").replace("T08:10:06", "T09:10:06"))
    ((start, duration),) = run.gaps
    assert (start, duration) == pytest.approx((4.0, 3601.0))
    assert run.duration_s == 3606.25
    assert any(note.startswith("line 12: nothing for 3601.0 s before it") for note in run.notes)


def test_a_clock_that_was_set_is_narrowed_by_the_control_s_own_seconds(tmp_path: Path) -> None:
    """Ten seconds within the run are no gap, but the control did not count them."""
    late = LOG.replace("08:10:05", "08:10:15").replace("08:10:06.25", "08:10:16.25")
    run = only(tmp_path, late.replace("08:10:15", "08:10:15.0Z|Program_Runtime_Seconds|5\n2026-03-02T08:10:15"))
    assert run.notes == (
        "line 14: Program_Runtime_Seconds is 5 at the end, by the time stamps the run took 16.2 s: it was held, or a "
        "clock was set",
    )
    assert run.gaps == ()


def test_two_block_numbers_at_one_time(tmp_path: Path) -> None:
    run = only(tmp_path, LOG.replace("08:10:02.0000000Z|Block_Number|8", "08:10:00.5000000Z|Block_Number|8"))
    assert values(run.block) == [(-0.1, 1), (0.5, 8), (5.0, 12)]
    assert "line 8: Block_Number twice at one time: the first value is ignored" in run.notes


def test_bad_values_and_time_stamps_are_left_out_with_their_lines(tmp_path: Path) -> None:
    bad = "".join(
        f"2026-03-02T08:10:05.{k}Z|Block_Number|{text}\n" for k, text in enumerate(["", "7.5", "-3", "nan", "N7"])
    )
    text = LOG.replace("2026-03-02T08:10:06.25", bad + "2026-13-02T08:10:06Z|Block_Number|13\n2026-03-02T08:10:06.25")
    run = only(tmp_path, text)
    assert values(run.block) == [(-0.1, 1), (0.5, 7), (2.0, 8), (5.0, 12)]
    assert run.notes == (
        "line 13: Block_Number is empty, ignored",
        "line 14: Block_Number is '7.5', no line number, ignored",
        "line 15: Block_Number is '-3', no line number, ignored",
        "2 more of the same kind, up to line 17",
        "line 18: '2026-13-02T08:10:06Z' is not a time stamp, the line is ignored",
    )


def test_no_word_of_a_state_means_one_run_without_duration(tmp_path: Path) -> None:
    text = "".join(line for line in LOG.splitlines(keepends=True) if "Program_Status" not in line)
    run = only(tmp_path, text)
    assert run.duration_s is None
    assert run.notes[0] == "no item shows when the program runs: the whole log is one run"


def test_what_cannot_be_read_is_refused(tmp_path: Path) -> None:
    refused(tmp_path, "", "the file is empty")
    refused(tmp_path, b"\x00\x01\x02|ab|c\n", r"a binary file \(byte 0x00 at 0\)")
    refused(tmp_path, "%\nO0001\nG0X1.\n", "not a log of runs: the file begins with b'%")
    refused(tmp_path, LOG.replace("2026-03-02T", "heute "), r"run.txt:1: 'heute 08:00:00.0000000Z' is not a time stamp")
    refused(
        tmp_path, LOG.replace("Block_Number", "Satzzaehler"),
        r"run.txt:13: no line numbers of the program: searched for block_number, .*the log has Current_Tool, "
        r"Feed_Override, Satzzaehler.*items = \{ block",
    )  # fmt: skip
    idle = LOG.replace("ACTIVE", "READY").replace("PROGRAM_COMPLETED", "IDLE")
    refused(tmp_path, idle, "no run: Program_Status never")
    refused(tmp_path, "2026-03-02T08:00:00Z|a|1\n2026-03-02T08:00:01Z|b|1\n", "no usable item.*the log has a, b")
    refused(
        tmp_path, LOG + "2026-03-02T08:20:00Z|M2:Program_Status|ACTIVE\n",
        r"run.txt:15: M2:Program_Status and Program_Status: the log has more than one control",
    )  # fmt: skip
    endless = "2026-03-02T08:10:02Z|@ASSET@|T1|CuttingTool|--multiline--AB12\n"
    refused(tmp_path, endless + LOG, r"run.txt:1: the asset that begins here does not end: no line is '--multiline-")
    refused(tmp_path, gzip.compress(LOG.encode())[:-40], "the packed file is cut off or damaged", "run.txt.gz")
    with pytest.raises(FileNotFoundError):
        sg.read_run_logs(tmp_path / "none.txt")
    with pytest.raises(IsADirectoryError, match=str(tmp_path)):
        sg.read_run_logs(tmp_path)
    with pytest.raises(sg.RecordError, match="format 'xml': must be one of shdr, mtconnect, edge, csv"):
        sg.read_run_logs(written(tmp_path, LOG), format="xml")  # type: ignore[arg-type]


@pytest.mark.parametrize("encoding", ["utf-8-sig", "utf-16"])
def test_encodings_of_windows(tmp_path: Path, encoding: str) -> None:
    path = tmp_path / "run.txt"
    path.write_bytes(LOG.replace("\n", "\r\n").encode(encoding))
    (run,) = sg.read_run_logs(path)
    assert values(run.block) == [(-0.1, 1), (0.5, 7), (2.0, 8), (5.0, 12)]


@pytest.mark.parametrize(
    ("stamp", "seconds"),
    [
        ("2026-03-02T08:10:02Z", 2.0), ("2026-03-02 08:10:02.5", 2.5), ("2026-03-02T10:10:02,25+02:00", 2.25),
        ("2026/03/02 08:10:02.125", 2.125), ("02.03.2026 08:10:02,5", 2.5), ("1772439002.5", 2.5),
        ("1772439002500", 2.5), ("2026-03-02T08:10:02,25Z", 2.25),
    ],
)  # fmt: skip
def test_spellings_of_time(tmp_path: Path, stamp: str, seconds: float) -> None:
    run = only(tmp_path, LOG.replace("2026-03-02T08:10:02.0000000Z", stamp))
    assert values(run.block)[2] == (seconds, 8)


# --- MTConnect streams ------------------------------------------------------------------------------------------------

NAMESPACE = "urn:mtconnect.org:MTConnectStreams"


def observed(tag: str, sequence: int, time: str, text: str, kind: str = "", identity: str = "") -> str:
    sub_type = f' subType="{kind}"' if kind else ""
    identity = identity or tag.lower()
    stamp = f"2026-03-02T{time}Z"
    return f'<{tag} dataItemId="{identity}" sequence="{sequence}"{sub_type} timestamp="{stamp}">{text}</{tag}>\n'


def streams(
    version: str = "2.0", spindle: str = "RotaryVelocity", line: str = "LineNumber", tool: str = "ToolId"
) -> str:
    """One run, by component and not by time, as agents send it."""
    return "".join(
        [
            '<?xml version="1.0" encoding="UTF-8"?>\n',
            f'<MTConnectStreams xmlns:m="{NAMESPACE}:{version}" xmlns="{NAMESPACE}:{version}">\n',
            '<Header creationTime="2026-03-02T08:20:00Z" instanceId="1" sender="agent" version="1.3"/>\n',
            '<Streams><DeviceStream name="M1" uuid="m1"><ComponentStream component="Rotary" name="C"><Samples>\n',
            observed(spindle, 13, "08:10:01", "4800", "ACTUAL", "c1"),
            observed(spindle, 12, "08:10:00", "5000", "PROGRAMMED", "c2"),
            '</Samples></ComponentStream><ComponentStream component="Path" name="P"><Samples>\n',
            observed("PathFeedrate", 15, "08:10:02.5", "16.9", "ACTUAL", "p1"),
            observed("PathFeedrate", 16, "08:10:02.5", "20", "PROGRAMMED", "p2"),
            "</Samples><Events>\n",
            observed(line, 11, "08:10:00.5", "7"),
            observed(line, 14, "08:10:02", "8"),
            observed(line, 17, "08:10:05", "12"),
            observed("Block", 18, "08:10:05", "N120 G1 X3 &amp; more"),
            observed("Execution", 10, "08:10:00", "ACTIVE"),
            observed("Execution", 19, "08:10:06.25", "PROGRAM_COMPLETED"),
            observed("PathFeedrateOverride", 8, "08:00:00", "90", "PROGRAMMED", "p6"),
            observed("PathFeedrateOverride", 9, "08:00:00", "50", "RAPID", "p7"),
            observed(tool, 7, "08:00:00", "5"),
            observed("Program", 6, "08:00:00", "PLATE"),
            "</Events><Condition>\n",
            observed("Normal", 5, "08:00:00", ""),
            "</Condition></ComponentStream></DeviceStream></Streams>\n</MTConnectStreams>\n",
        ]
    )


@pytest.mark.parametrize(
    "names",
    [("1.1", "SpindleSpeed", "Line", "ToolId"), ("1.4", "RotaryVelocity", "LineNumber", "ToolAssetId"),
     ("2.0", "RotaryVelocity", "LineNumber", "ToolNumber")],
    ids=lambda names: names[0],
)  # fmt: skip
def test_streams_are_put_in_the_order_of_their_sequence(tmp_path: Path, names: tuple[str, str, str, str]) -> None:
    run = only(tmp_path, streams(*names), "streams.xml")
    assert (run.start, run.duration_s) == ("2026-03-02T08:10:00Z", 6.25)
    assert values(run.block) == [(0.5, 7), (2.0, 8), (5.0, 12)]
    assert values(run.feed) == [(2.5, 16.9)]
    assert run.feed_unit == "mm/s"
    assert values(run.spindle_rpm) == [(1.0, 4800)]
    assert values(run.tool) == [(0.0, 5)]
    assert values(run.feed_override) == [(0.0, 0.9)]
    assert values(run.rapid_override) == [(0.0, 0.5)]
    assert (run.program, run.block_texts) == ("PLATE", ((5.0, "N120 G1 X3 & more"),))


def test_positions_of_linear_axes(tmp_path: Path) -> None:
    axis = '<ComponentStream component="Linear" name="{}"><Samples>\n{}</Samples></ComponentStream>'
    x = axis.format("X", observed("Position", 13, "08:10:01", "12.5", "ACTUAL", "x1"))
    x += axis.format("Z", observed("Position", 13, "08:10:01", "7", "COMMANDED", "z1"))
    x += axis.format("W", observed("Position", 13, "08:10:01", "9", "ACTUAL", "w1"))
    run = only(tmp_path, streams().replace("<ComponentStream", x + "<ComponentStream", 1), "streams.xml")
    ((name, signal),) = run.position_mm
    assert (name, values(signal)) == ("x", [(1.0, 12.5)])


def test_many_documents_in_a_file_with_what_they_share(tmp_path: Path) -> None:
    """As a multipart answer is saved: headers between the documents; the second one repeats values."""
    whole = streams()
    rows = whole.splitlines(keepends=True)
    late = ('sequence="17"', 'sequence="18"', 'sequence="19"')
    first = "".join(row for row in rows if not any(mark in row for mark in late))
    between = "--boundary\r\nContent-type: text/xml\r\nContent-length: 2000\r\n\r\n"
    run = only(tmp_path, between + first + between + whole + "--boundary--\r\n", "streams.txt")
    assert values(run.block) == [(0.5, 7), (2.0, 8), (5.0, 12)]
    assert (run.duration_s, run.notes) == (6.25, ())


def test_only_n_words_of_blocks(tmp_path: Path) -> None:
    text = "".join(row for row in streams().splitlines(keepends=True) if "<LineNumber" not in row)
    run = only(tmp_path, text, "streams.xml")
    assert (run.block_counts, values(run.block)) == ("sequence", [(5.0, 120)])
    assert any("no line numbers: the N words of 1 of 1 blocks are used" in note for note in run.notes)


def test_streams_that_are_refused(tmp_path: Path) -> None:
    whole = streams()
    cut = whole[: whole.index("<Condition>")]
    refused(tmp_path, cut, r"a.xml:\d+: the document begun in line 1 is truncated within <ComponentStream>", "a.xml")
    refused(tmp_path, whole + cut, rf"begun in line {whole.count(chr(10)) + 1} is truncated within", "a.xml")
    refused(tmp_path, whole.replace("</Samples>", "</Sample>", 1), r"a.xml:7: incomplete XML: mismatched tag", "a.xml")
    refused(tmp_path, whole.replace("MTConnectStreams", "MTConnectDevices"), "the answer to `probe`", "a.xml")
    bomb = '<?xml version="1.0"?><!DOCTYPE a [<!ENTITY x "y">]><MTConnectStreams/>'
    refused(tmp_path, bomb, "a.xml:1: a declared entity", "a.xml")
    refused(tmp_path, "<html><body>401</body></html>", r"no MTConnectStreams document", "a.xml")


# --- tables and captures ----------------------------------------------------------------------------------------------


def test_tables_with_named_columns(tmp_path: Path) -> None:
    comma = "made by logger 3\ntime_ms,Line,Feed [mm/min],tool,x_mm,status\n"
    rows = [(0, 1, 0, 4, 0, "ACTIVE"), (500, 7, 1016, 4, 1.5, "ACTIVE"), (2000, 8, 1016, 4, 3, "ACTIVE"),
            (2500, 9, 0, 5, 3, "PROGRAM_COMPLETED")]  # fmt: skip
    run = only(tmp_path, comma + "\n".join(",".join(map(str, row)) for row in rows), "run.csv")
    assert run.duration_s == 2.5
    assert values(run.block) == [(0.0, 1), (0.5, 7), (2.0, 8), (2.5, 9)]
    assert values(run.feed)[1] == (0.5, 1016)
    assert run.feed_unit == "mm/min"
    assert dict(run.position_mm)["x"].value.tolist() == [0, 1.5, 3, 3]
    assert run.notes == ()


def test_a_german_table_with_clock_times(tmp_path: Path) -> None:
    text = "Zeit;Satznummer;Vorschub\n02.03.2026 08:10:00,5;7;16,93\n02.03.2026 08:10:02,0;8;16,9\n"
    run = only(tmp_path, text, "run.csv")
    assert values(run.block) == [(0.0, 7), (1.5, 8)]
    assert values(run.feed) == [(0.0, 16.93), (1.5, 16.9)]
    assert run.feed_unit is None and run.duration_s is None
    assert run.notes == ("no item shows when the program runs: the whole log is one run",)


def test_units_of_tables_are_converted_said_or_refused(tmp_path: Path) -> None:
    run = only(tmp_path, "t,line,x [inch],feed [inch/min]\n0,1,1,40\n1,2,2,40\n", "run.csv")
    assert dict(run.position_mm)["x"].value.tolist() == [25.4, 50.8]
    assert run.feed_unit == "inch/min"
    assert "line 1: t has no unit: s is assumed" in run.notes
    refused(tmp_path, "t,line,feed [V]\n0,1,1\n", r"run.csv:1: 'feed \[V\]': the unit 'V' is not known", "run.csv")
    refused(tmp_path, "t,line,feed [mm]\n0,1,1\n", r"run.csv:1: 'feed \[mm\]' has the unit mm of displ", "run.csv")


def test_tables_that_are_refused(tmp_path: Path) -> None:
    refused(tmp_path, "t,force\n0,1\n1,2\n", r"run.csv:1: no header with a time .* has t, force", "run.csv")
    refused(tmp_path, "t_s,line\n0,5,7\n", r"run.csv:2: 3 cells, the header has 2; decimal commas need", "run.csv")
    refused(tmp_path, "t,line\nmonday,1\n", r"run.csv:2: t is 'monday': must be a number or a time", "run.csv")


def test_a_table_with_bad_rows(tmp_path: Path) -> None:
    run = only(tmp_path, "time_s,line,feed\n0,1,0\n1,,5\nx,3,5\n3,4\n", "run.csv")
    assert values(run.block) == [(0.0, 1), (3.0, 4)]
    assert set(run.notes) >= {
        "line 3: line is empty, ignored",
        "line 4: time_s is 'x', not a time; the row is ignored",
        "line 5: 2 cells of 3",
    }


def test_a_sinumerik_capture() -> None:
    (run,) = sg.read_run_logs(NIST.parent / "sinumerik" / "capture.json.gz")
    assert run.cut_start and run.cut_end and run.duration_s is None
    assert len(run.block_texts) == 78
    assert {axis for axis, _ in run.position_mm} == {"x", "y", "z"}
    assert run.gaps[0] == pytest.approx((2.986, 7.72), abs=0.003)
