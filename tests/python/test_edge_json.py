"""Captures of Sinumerik controls: what is in the file comes out, what cannot be is refused with its place."""

import copy
import gzip
import json
import zipfile
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import shapegcode as sg
from edge_writer import MEASURED, edge_document, write_edge


def block(counter: int, text: str, tool: int | str = 6) -> dict[str, Any]:
    kept = {"Channel": 1, "SeekOffset": 12, "IpoGC": "G1", "ipoReadError": None, "laBuf": "3"}
    tools = {"SelectedTool": tool, "ActiveTool": tool}
    return {"HFBlockEvent": {"HFProbeCounter": counter, "GCode": text, **tools, **kept}}


@pytest.fixture
def document() -> dict[str, Any]:
    way = np.linspace(0.0, 30.0, 301)
    call = {"HFCallEvent": {"HFProbeCounter": 5_000_000, "SeekOffset": 4, "CallStackLevel": 1, "Path": "/_PART"}}
    slow = {"LFData": [{"HfProbeCounter": "5000100", "address": "/Channel/State/actTNumber", "value": "6"}]}
    return edge_document(
        {"DES_POS|1": way, "ENC_POS|1": way - 0.1, "DES_POS|2": np.zeros(301)},
        events=(call, block(5_000_010, "G1 X30 F3000"), slow),
    )


def test_what_is_in_the_file_comes_out(document: dict[str, Any], tmp_path: Path) -> None:
    capture = sg.read_edge_json(write_edge(tmp_path / "a.json", document))
    assert capture.cycle_s == 0.002
    assert capture.notes == ()
    assert capture.time_s == pytest.approx(0.002 * np.arange(301), abs=1e-12)
    assert capture.column("ENC_POS", "X1") == pytest.approx(np.linspace(0.0, 30.0, 301) - 0.1, abs=1e-8)
    assert capture.speed("x1") == pytest.approx(50.0, abs=1e-4)
    assert [axis.number for axis in capture.axes] == [1, 2]
    (found,) = capture.blocks
    assert (found.text, found.path, found.active_tool, found.buffered) == ("G1 X30 F3000", "/_PART", 6, 3)
    assert found.time_s == pytest.approx(0.020)
    (value,) = capture.values
    assert (value.value, value.time_s) == ("6", pytest.approx(0.2))


def test_the_measured_capture() -> None:
    """Against its text, read by eye: first row, first block, the gap between two counters, the turns of axis 3."""
    capture = sg.read_edge_json(MEASURED)
    assert len(capture.time_s) == 3818
    assert capture.column("DES_POS", 1)[0] == -61.890974
    assert capture.column("ENC_POS", 3)[0] == -6675.991504
    assert capture.blocks[0].text == "M17"
    assert capture.blocks[0].time_s == pytest.approx(0.010)
    assert (len(capture.blocks), len(capture.calls), len(capture.values)) == (78, 49, 70)
    (gap,) = capture.gaps
    assert (gap.counter, gap.missing) == (5559591, 3859)
    assert gap.duration_s == pytest.approx(7.72)
    assert capture.time_s[-1] == pytest.approx((5565774 - 5558098) * 0.002)
    # Its time stamps leave the gap out; its counter and its slow values (5559609: 43.892 s, 5563859: 52.392 s) do not.
    assert any("the clock and the counter disagree" in note for note in capture.notes)
    # 700 and 1683 rpm: without jumps of whole turns the speed is even; with them it would pass 10^5.
    assert np.abs(capture.speed(3)).max() < 4300.0
    assert np.abs(capture.speed(5)).max() == pytest.approx(10098.0)
    assert [capture.is_rotary(axis.number) for axis in capture.axes] == [False, False, True, False, True, False]
    for axis in range(1, 7):
        straight = capture.position(axis) - capture.position(axis, actual=True)
        raw = capture.column("DES_POS", axis) - capture.column("ENC_POS", axis)
        assert straight == pytest.approx(raw, abs=1e-9)


def test_turns_are_taken_out_and_begin_anew_behind_a_gap(tmp_path: Path) -> None:
    straight = -8.4 * np.arange(200)
    counter = [*range(100), *range(500, 600)]
    document = edge_document({"DES_POS|3": np.mod(straight, 360.0)}, counter=counter)
    capture = sg.read_edge_json(write_edge(tmp_path / "a.json", document))
    place = capture.position(3)
    assert place[:100] == pytest.approx(straight[:100], abs=1e-6)
    assert np.diff(place[100:]) == pytest.approx(-8.4, abs=1e-6)
    assert place[100] == capture.column("DES_POS", 3)[100]
    assert capture.speed(3) == pytest.approx(-4200.0, abs=1e-3)


def test_packed_files_and_chains(document: dict[str, Any], tmp_path: Path) -> None:
    text = json.dumps(document).encode()
    packed = tmp_path / "a.json.gz"
    packed.write_bytes(gzip.compress(text))
    assert len(sg.read_edge_json(packed).time_s) == 301
    first, second = copy.deepcopy(document), copy.deepcopy(document)
    # The recorder repeats the last block of a file at the beginning of the next one.
    first["Payload"] = document["Payload"][:2] + document["Payload"][3:]
    second["Payload"] = [document["Payload"][-2], document["Payload"][2]]
    archive = tmp_path / "a.zip"
    with zipfile.ZipFile(archive, "w") as file:
        file.writestr("2.json", json.dumps(second))
        file.writestr("1.json", json.dumps(first))
    whole = sg.read_edge_json(archive)
    assert len(whole.time_s) == 301
    assert len(whole.blocks) == 1
    assert whole.gaps == ()


def test_counter_that_begins_anew_and_repeated_rows(tmp_path: Path) -> None:
    top = (1 << 31) - 1
    document = edge_document(
        {"DES_POS|1": np.arange(5.0)}, counter=[top - 1, top, 0, 1, 2], events=(block(1, "G1"),), first=top - 1
    )
    document["Payload"].insert(1, {"HFData": [document["Payload"][0]["HFData"][-1]]})
    capture = sg.read_edge_json(write_edge(tmp_path / "a.json", document))
    assert capture.time_s == pytest.approx(0.002 * np.arange(5))
    assert capture.blocks[0].time_s == pytest.approx(0.006)
    assert capture.gaps == ()
    assert len(capture.notes) == 2


def _row(change: Callable[[list[Any]], Any]) -> Callable[[dict[str, Any]], None]:
    def apply(document: dict[str, Any]) -> None:
        change(document["Payload"][1]["HFData"][7])

    return apply


def _set(value: Any, *keys: str | int) -> Callable[[dict[str, Any]], None]:
    def apply(document: dict[str, Any]) -> None:
        place: Any = document
        for key in keys[:-1]:
            place = place[key]
        place[keys[-1]] = value

    return apply


BAD: list[tuple[Callable[[dict[str, Any]], Any], str]] = [
    (_row(lambda row: row.pop()), r"Payload\[1\].HFData\[7\] has 3 values: SignalListHFData lists 4"),
    (_row(lambda row: row.__setitem__(1, "1.5")), r"HFData\[7\]: DES_POS\|1 = '1.5': must be a number"),
    (_row(lambda row: row.__setitem__(1, True)), r"DES_POS\|1 = True: must be a number"),
    (_row(lambda row: row.__setitem__(2, float("inf"))), r"HFData\[7\]: ENC_POS\|1 = inf: must be finite"),
    (_row(lambda row: row.__setitem__(2, -1e13)), r"ENC_POS\|1 = -1e\+13: must be finite and at most 1e\+12"),
    (_row(lambda row: row.__setitem__(1, 10**400)), r"whole number 100000000000\.\.\. \(401 digits\): must be"),
    (_row(lambda row: row.__setitem__(0, 5_000_090)), r"HFData\[7\]: CYCLE = 5000090 after 5000107: the counter goes"),
    (_row(lambda row: row.__setitem__(0, 5_000_107)), r"HFData\[7\]: CYCLE = 5000107 .* other values under the same"),
    (_row(lambda row: row.__setitem__(0, 5_000_107.5)), r"CYCLE = .*: must be a whole number"),
    (_row(lambda row: row.__setitem__(0, None)), r"CYCLE = nan: must be a whole number"),
    (_set({}, "Payload", 1, "HFData"), r"Payload\[1\].HFData = '\{\}': must be a list"),
    (_set([3], "Payload", 1, "HFData"), r"Payload\[1\].HFData\[0\] has '3'"),
    (_set("x", "Payload", 2), r"Payload\[2\] = 'x': must be an object"),
    (_set([], "Payload"), "has 0 rows of HFData"),
    (_set(None, "Payload"), "Payload is missing"),
    (_set("2.0", "Header", "Version", "outputFileFormatVersion"), "outputFileFormatVersion = 2.0: must be 0.6 to 1.1"),
    (_set("0.5", "Header", "Version", "outputFileFormatVersion"), "= 0.5: must be 0.6"),
    (_set("new", "Header", "Version", "outputFileFormatVersion"), "= new: must be 0.6"),
    (_set(None, "Header", "Version"), "outputFileFormatVersion = None"),
    (_set("CSV", "Header", "Format"), "Header.Format = 'CSV': must be 'DEFAULT'"),
    (_set(0, "Header", "CycleTimeMs"), "Header.CycleTimeMs = 0: must be"),
    (_set(None, "Header", "CycleTimeMs"), "Header.CycleTimeMs = None: must be"),
    (_set([], "Header", "SignalListHFData"), "SignalListHFData is missing or empty"),
    (lambda each: each["Header"]["SignalListHFData"].pop(0), "has no CYCLE"),
    (_set({}, "Header", "SignalListHFData", 1), r"SignalListHFData\[1\] has no Address"),
    (_set({"Address": "ENC_POS|1"}, "Header", "SignalListHFData", 1), r"\[2\]: ENC_POS\|1 is listed twice"),
    (_set("many", "Payload", 4, "HFBlockEvent", "HFProbeCounter"), r"\[4\].HFBlockEvent.HFProbeCounter = 'many'"),
    (lambda each: each["Payload"][4]["HFBlockEvent"].pop("HFProbeCounter"), "HFProbeCounter is missing"),
    (lambda each: each.pop("Header"), "no Header"),
]


@pytest.mark.parametrize(("change", "message"), BAD, ids=[message[:40] for _, message in BAD])
def test_what_cannot_be_is_refused(
    change: Callable[[dict[str, Any]], Any], message: str, document: dict[str, Any], tmp_path: Path
) -> None:
    change(document)
    with pytest.raises(sg.RecordError, match=message):
        sg.read_edge_json(write_edge(tmp_path / "a.json", document))


@pytest.mark.parametrize("share", [0.1, 0.5, 0.99, 0.99999])
def test_a_file_that_is_cut_off(share: float, document: dict[str, Any], tmp_path: Path) -> None:
    text = json.dumps(document)
    file = tmp_path / "cut.json"
    file.write_text(text[: int(share * len(text))])
    with pytest.raises(sg.RecordError, match=r"cut.json:1: not complete JSON: column"):
        sg.read_edge_json(file)
    packed = gzip.compress(text.encode())
    file.write_bytes(packed[: int(share * len(packed)) - 1])
    with pytest.raises(sg.RecordError, match="cut off or damaged"):
        sg.read_edge_json(file)


@pytest.mark.parametrize(
    ("data", "message"),
    [
        (b"", "the file is empty"),
        (b"\xff\xfe\x00", "not UTF-8"),
        (b"[1, 2]", "no Header"),
        (b"time_s,X\n0,1\n", "not complete JSON"),
        (b"[" * 200_000, "nested too deeply|not complete JSON"),
        (b"PK\x03\x04rest", "cut off or damaged"),
    ],
)
def test_other_files(data: bytes, message: str, tmp_path: Path) -> None:
    file = tmp_path / "a.json"
    file.write_bytes(data)
    with pytest.raises(sg.RecordError, match=message):
        sg.read_edge_json(file)


def test_what_is_missing_is_said(document: dict[str, Any], tmp_path: Path) -> None:
    document["Payload"][0]["HFData"][3][2] = None
    document["Payload"][0]["HFData"][4][2] = float("nan")
    document["Payload"].append({"ExternalData": []})
    document["Footer"]["ErrorMessages"] = ["data lost"]
    document["Footer"]["FilePathChain"]["Next"] = "b.json"
    document["Header"]["Version"]["outputFileFormatVersion"] = "1.2"
    capture = sg.read_edge_json(write_edge(tmp_path / "a.json", document))
    assert np.isnan(capture.column("ENC_POS", 1)).sum() == 2
    said = " / ".join(capture.notes)
    for part in (
        "ENC_POS|1: no value in 2 of 301",
        "1 entries ExternalData",
        "data lost",
        "continues in b.json",
        "newer",
    ):
        assert part in said
    document["Footer"] = {"ErrorMessages": 7, "FilePathChain": []}
    assert "reports an error: 7" in " ".join(sg.read_edge_json(write_edge(tmp_path / "a.json", document)).notes)
    with pytest.raises(sg.RecordError, match=r"no ENC_POS\|2; recorded of axis 2 \(Y1\) are DES_POS"):
        capture.position(2, actual=True)
    with pytest.raises(sg.RecordError, match=r"no axis 'Q'; the file has 1 \(X1\), 2 \(Y1\)"):
        capture.position("Q")
