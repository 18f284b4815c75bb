"""Valid files with something wrong in them: read, or refused in words; no crash, no wait, no gigabytes. One kind here:
``python tests/python/test_fuzzed_files.py KIND FOLDER SEED COUNT`` says what broke."""

import gzip
import io
import json
import os
import random
import resource
import signal
import struct
import subprocess
import sys
import traceback
import warnings
import zipfile
import zlib
from collections.abc import Callable, Iterable
from pathlib import Path
from typing import Any

import pytest

from effort import trials
from faults import ANSWERS, MAX_BYTES, MAX_CPU_S, changed

TESTS = Path(__file__).resolve().parents[1]
DATA = TESTS.parent / "python" / "shapegcode" / "data"
_QUICK, _MANY = 30, trials(3000)
#: Each file of these starts a process.
_SLOW_KINDS = {"mat": 6}

JSON_ANSWERS = '{"name": "VMC-3", "dnc_baud": 9600, "delivery": "dnc", "contour_um": 15, "modes": {"x": "46:0.02"}}'
RUNS = """[[runs]]
program = "p.nc"
logs = ["log.txt"]
feed_unit = "in/min"
items = { block = "line", status = "execution" }
format = "shdr"
override_percent = 90
rapid_override_percent = 50.0
"""
TABLES = "%\nG10L2P1X-12.5Y3.Z0\nG10L10P1R10.25\nG10L12P1R4.\nG10L85P500(4024000000000000)\n#501=[1.+2.]*3\n%\n"
TABLE = "time,line,status\n" + "".join(f"{k},{k},ACTIVE\n" for k in range(30))
PROGRAM = b"%\nO1\nG21G17G90G94\nG0X0Y0Z0\nG1X10.F600\nY10.\nG0Z50.\nM30\n%\n"
STREAMS = """<?xml version="1.0" encoding="UTF-8"?>
<MTConnectStreams xmlns="urn:mtconnect.org:MTConnectStreams:1.3"><Header instanceId="7" lastSequence="9"/><Streams>
<DeviceStream name="a"><ComponentStream component="Path" name="p"><Events>
<Program dataItemId="p1" timestamp="2026-11-24T10:00:00.000Z" sequence="1">A.NC</Program>
<Execution dataItemId="e1" timestamp="2026-11-24T10:00:01.000Z" sequence="2">ACTIVE</Execution>
<Line dataItemId="l1" timestamp="2026-11-24T10:00:02.000Z" sequence="3">12</Line>
<Execution dataItemId="e1" timestamp="2026-11-24T10:00:09.000Z" sequence="4">READY</Execution>
</Events></ComponentStream></DeviceStream></Streams></MTConnectStreams>
"""


def _capture() -> bytes:
    signals = [{"Name": name, "Type": "INTEGER", "Address": name} for name in ("CYCLE", "DES_POS|1", "ENC_POS|1")]
    rows = [[500 + k, k * 0.01, k * 0.0101] for k in range(40)]
    document = {
        "Header": {"Version": {"OutputFileFormatVersion": "1.0"}, "CycleTimeMs": 2.0, "SignalListHFData": signals},
        "Payload": [{"HFData": rows}],
        "Footer": {"ErrorMessages": []},
    }
    return json.dumps(document).encode()


def _columns(header: str, count: int = 128) -> bytes:
    import math

    values = (f"{k * 0.001:.4f},{10.0 * math.exp(-k):.5f},{math.sin(k / 3.0):.5f}\n" for k in range(count))
    return (header + "\n" + "".join(values)).encode()


def _klipper() -> bytes:
    head, _, rows = _columns("#time,accel_x,accel_y,accel_z").partition(b"\n")
    return head + b"\n" + rows.replace(b"\n", b",0.5\n")


def _wav(folder: Path) -> bytes:
    import numpy as np
    from scipy.io import wavfile

    wavfile.write(folder / "seed.wav", 4000, np.sin(np.arange(200) / 9.0).astype(np.float32))
    return (folder / "seed.wav").read_bytes()


def _uff(folder: Path, binary: int) -> bytes:
    import numpy as np
    import pyuff

    from test_tap_files import dataset

    path = folder / "seed.uff"
    path.unlink(missing_ok=True)
    data = dataset(np.sin(np.arange(64) * 0.099), 12, binary=binary)
    pyuff.UFF(str(path)).write_sets([data], mode="add")
    return path.read_bytes()


def _mat(folder: Path) -> bytes:
    import numpy as np
    from scipy.io import savemat

    hz = np.arange(1.0, 64.0)
    savemat(folder / "seed.mat", {"f": hz, "H": np.exp(1j * hz) * 1e-6, "s": {"a": hz, "unit": "m/N"}})
    return (folder / "seed.mat").read_bytes()


def _packed_mat(data: bytes) -> bytes:
    """What is wrong lies within whole zlib streams: only there SciPy reads it without checks."""
    body, at = b"", 128
    while at + 8 <= len(data):
        size = struct.unpack_from("<I", data, at + 4)[0] + 8
        packed = zlib.compress(data[at : at + size])
        body += struct.pack("<II", 15, len(packed)) + packed
        at += max(8, size)
    return data[:128] + body


def _zipped(data: bytes) -> bytes:
    stream = io.BytesIO()
    with zipfile.ZipFile(stream, "w", zipfile.ZIP_DEFLATED) as archive:
        archive.writestr("a.json", data)
    return stream.getvalue()


def _as_it_is(data: bytes) -> bytes:
    return data


Kind = tuple[str, Callable[[Path], bytes], Callable[[bytes], bytes], Callable[[Path], Any]]


def _kinds() -> dict[str, Kind]:
    """Name of the file, a valid one, what is done with it once it is changed, and its reader."""
    import shapegcode as sg
    from command import run
    from shapegcode.characterization.programs import read_sheet
    from shapegcode.cutting.stock import Stock
    from shapegcode.cutting.tool import Tool
    from shapegcode.identification.servo.record import read_servo_record
    from shapegcode.io.edge_json import read_edge_json
    from shapegcode.io.read import read_measurement
    from shapegcode.machine.control_import import import_parameters
    from shapegcode.setup.answers import read_answers
    from shapegcode.studies.study_file import load_study
    from shapegcode.testcut.cut import read_test_cut

    def file(path: Path) -> Callable[[Path], bytes]:
        return lambda _: path.read_bytes()

    def text(words: str) -> Callable[[Path], bytes]:
        return lambda _: words.encode()

    def result(folder: Path) -> bytes:
        (folder / "p.nc").write_bytes(PROGRAM)
        run(folder, "time", "p.nc", "-m", "vx500", "--json", "seed.json")
        return (folder / "seed.json").read_bytes()

    def test_cut(folder: Path) -> bytes:
        tool = DATA / "milling" / "paper001_tool.toml"
        run(folder, "testcut", "taper", "-m", "vx500", "--tool", tool, "-o", "CUT.NC", "-a", "5", "-F", "300")
        return (folder / "CUT.json").read_bytes()

    def sheet(folder: Path) -> bytes:
        run(folder, "characterize", "--write", "tests", "-m", "vx500")
        return (folder / "tests" / "RESULTS.toml").read_bytes()

    def program(path: Path) -> Any:
        vx500 = sg.Machine.load("vx500").with_values({"controller.max_program_steps": 20_000})
        return sg.cycle_time(sg.Program.read(path, vx500), vx500), sg.check(path, vx500)

    old = TESTS / "golden/parameters/with_q.txt"
    log = gzip.decompress((DATA / "measured/nist/logs/COVER-run3.txt.gz").read_bytes())[:12_000]
    return {
        "machine": ("a.toml", file(DATA / "vx500.toml"), _as_it_is, sg.Machine.load),
        "study": ("a.toml", file(TESTS / "golden/study/STUDY.toml"), _as_it_is, load_study),
        "runs": ("a.toml", text(RUNS), _as_it_is, sg.load_runs),
        "answers": ("a.toml", text(ANSWERS), _as_it_is, read_answers),
        "answers in json": ("a.json", text(JSON_ANSWERS), _as_it_is, read_answers),
        "tool": ("a.toml", file(TESTS / "golden/feed/pocket_tool.toml"), _as_it_is, Tool.load),
        "stock": ("a.toml", file(TESTS / "golden/feed/pocket_stock.toml"), _as_it_is, Stock.load),
        "sheet": ("a.toml", sheet, _as_it_is, read_sheet),
        "dump": ("a.txt", file(TESTS / "golden/parameters/with_q.txt"), _as_it_is, import_parameters),
        "old dump": ("a.txt", file(TESTS / "golden/parameters/old.txt"), _as_it_is, import_parameters),
        "tables": ("a.txt", text(TABLES), _as_it_is, lambda path: import_parameters(old, tables=[path])),
        "result": ("a.json", result, _as_it_is, sg.load_result),
        "test cut": ("a.json", test_cut, _as_it_is, read_test_cut),
        "tap": ("a.csv", lambda _: _columns("time_s,force_N,acc_m/s^2"), _as_it_is, read_measurement),
        "response": ("a.csv", lambda _: _columns("frequency_Hz,real_m/N,imag_m/N"), _as_it_is, read_measurement),
        "klipper": ("raw_data_x_a.csv", lambda _: _klipper(), _as_it_is, read_measurement),
        "servo log": ("a.csv", lambda _: _columns("time_s,x_command_mm,x_actual_mm"), _as_it_is, read_servo_record),
        "wav": ("a.wav", _wav, _as_it_is, read_measurement),
        "uff": ("a.uff", lambda folder: _uff(folder, 0), _as_it_is, read_measurement),
        "binary uff": ("a.uff", lambda folder: _uff(folder, 1), _as_it_is, read_measurement),
        "mat": ("a.mat", _mat, _packed_mat, read_measurement),
        "shdr": ("a.txt", lambda _: log, _as_it_is, sg.read_run_logs),
        "packed shdr": ("a.txt.gz", lambda _: gzip.compress(log), _as_it_is, sg.read_run_logs),
        "streams": ("a.xml", text(STREAMS), _as_it_is, sg.read_run_logs),
        "table": ("a.csv", text(TABLE), _as_it_is, sg.read_run_logs),
        "capture": ("a.json", lambda _: _capture(), _as_it_is, read_edge_json),
        "packed capture": ("a.json.gz", lambda _: _capture(), gzip.compress, read_edge_json),
        "zip": ("a.zip", lambda _: _zipped(_capture()), _as_it_is, read_edge_json),
        "program": ("a.nc", lambda _: PROGRAM, _as_it_is, program),
        "macro": ("a.nc", file(TESTS / "golden/dialect/nested_macros.nc"), _as_it_is, program),
        "loops": ("a.nc", file(TESTS / "golden/dialect/while_pocket.nc"), _as_it_is, program),
    }  # fmt: skip


KINDS = (
    "machine", "study", "runs", "answers", "answers in json", "tool", "stock", "sheet", "dump", "old dump", "tables",
    "result", "test cut", "tap", "response", "klipper", "servo log", "wav", "uff", "binary uff", "mat", "shdr",
    "packed shdr", "streams", "table", "capture", "packed capture", "zip", "program", "macro", "loops",
)  # fmt: skip


class _TooSlow(BaseException):
    pass


def _stop(*_: object) -> None:
    raise _TooSlow


def fuzz(kind: str, folder: Path, seed: int, count: int) -> Iterable[str]:
    """Read changed files of a kind; what broke, as it breaks. The file that was read last stays in the folder."""
    import shapegcode as sg

    name, made, finish, read = _kinds()[kind]
    path, whole = folder / name, made(folder)
    (folder / "p.nc").write_bytes(PROGRAM)
    (folder / "log.txt").write_text("2026-11-24T10:00:00Z|execution|ACTIVE\n")
    path.write_bytes(finish(whole))
    read(path)  # what is changed below is a good file
    read_well = 0
    warnings.simplefilter("error")
    signal.signal(signal.SIGPROF, _stop)
    for number in range(count):
        draw = random.Random(f"{kind} {seed} {number}")
        path.write_bytes(finish(changed(whole, draw)))
        signal.setitimer(signal.ITIMER_PROF, MAX_CPU_S)
        try:
            read(path)
            read_well += 1
        except (sg.ShapegcodeError, OSError) as error:
            if len(str(error)) > 20_000:
                yield f"{kind} {seed} {number}: a message of {len(str(error))} characters"
        except (Exception, _TooSlow):
            yield f"{kind} {seed} {number}: {traceback.format_exc()[-1500:]}"
        finally:
            signal.setitimer(signal.ITIMER_PROF, 0)
    print(f"{kind}: {count} files, {read_well} of them read", file=sys.stderr)


def found_by(kind: str, folder: Path, seed: int, count: int) -> str:
    """The same in a process of its own with limits of memory; what broke, or that it crashed."""
    done = subprocess.run(
        [sys.executable, __file__, kind, str(folder), str(seed), str(count)],
        capture_output=True,
        text=True,
        check=False,
        env={**os.environ, "OPENBLAS_NUM_THREADS": "1"},
    )
    crash = f"{kind} {seed}: ended with {done.returncode}: {done.stderr[-1500:]}" if done.returncode else ""
    return done.stdout + crash


@pytest.mark.parametrize("kind", KINDS)
def test_changed_files_are_read_or_refused(kind: str, tmp_path: Path) -> None:
    assert found_by(kind, tmp_path, 1, min(_QUICK, _SLOW_KINDS.get(kind, _QUICK))) == ""


@pytest.mark.slow
@pytest.mark.parametrize("kind", KINDS)
def test_many_changed_files_are_read_or_refused(kind: str, tmp_path: Path) -> None:
    assert found_by(kind, tmp_path, 2, _MANY // 10 if kind in _SLOW_KINDS else _MANY) == ""


def test_every_kind_is_in_the_list() -> None:
    assert tuple(_kinds()) == KINDS


def test_the_fuzzer_finds_what_it_is_for(tmp_path: Path) -> None:
    code = f"""
import sys
sys.path[:0] = {[str(TESTS / "python"), str(TESTS / "oracles")]!r}
import test_fuzzed_files as fuzzed
from pathlib import Path
def bad(path):
    size = len(path.read_bytes()) % 3
    if size == 0: raise KeyError("a")
    if size == 1: bytearray(4 << 30)
fuzzed.limit()
fuzzed._kinds = lambda: {{"bad": ("a", lambda _: b"abcde", fuzzed._as_it_is, bad)}}
print(len(list(fuzzed.fuzz("bad", Path({str(tmp_path)!r}), 1, 30))))
"""
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert 10 < int(done.stdout) < 30


def limit() -> None:
    """From now on this process has no more memory than is allowed for a small file."""
    status = Path("/proc/self/status").read_text()
    taken = int(status.partition("VmSize:")[2].split()[0]) * 1024
    resource.setrlimit(resource.RLIMIT_AS, (taken + MAX_BYTES,) * 2)


if __name__ == "__main__":
    sys.path[:0] = [str(TESTS / "python"), str(TESTS / "oracles")]
    _kinds()
    limit()
    for broken in fuzz(sys.argv[1], Path(sys.argv[2]), int(sys.argv[3]), int(sys.argv[4])):
        print(broken, flush=True)
