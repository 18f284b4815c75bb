"""Attacks on readers: files that are none, bombs, damaged records. A message with the file, exit code 2, at once."""

import contextlib
import json
import os
import random
import signal
import struct
import zlib
from collections.abc import Iterator
from pathlib import Path

import numpy as np
import pytest
from scipy.io import savemat, wavfile

import shapegcode as sg
from command import run
from faults import RECORD_BOMBS, TOML_BOMBS, command, sound

PROGRAM = "%\nO1\nG21G17G90G94\nG0X0Y0Z0\nG1X10.F600\nY10.\nG0Z50.\nM30\n%\n"
RUNS = "[[runs]]\nprogram = 'p.nc'\nlog = '{}'\n"
M = ("-m", "vx500")

#: Every argument that names a file to read: FILE stands for it.
READ = {
    "convert": ("convert", "FILE", *M, "-o", "o.nc"),
    "simulate": ("simulate", "FILE", *M),
    "simulate --against": ("simulate", "p.nc", *M, "--against", "FILE"),
    "check": ("check", "FILE", *M),
    "time": ("time", "FILE", *M),
    "expand": ("expand", "FILE", *M, "-o", "o.nc"),
    "measure": ("measure", "FILE", *M, "--tool-diameter", "6mm"),
    "compare A": ("compare", "FILE", "p.nc", *M),
    "compare B": ("compare", "p.nc", "FILE", *M),
    "program all": ("time", "FILE", *M, "--program", "all"),
    "machine": ("time", "p.nc", "-m", "FILE"),
    "machine show": ("machine", "show", "FILE"),
    "machine diff": ("machine", "diff", "vx500", "FILE"),
    "machine import": ("machine", "import", "FILE"),
    "machine import, tables": ("machine", "import", "FILE", "p.nc"),
    "study": ("study", "FILE"),
    "optimize": ("optimize", "FILE"),
    "answers": ("setup", "--answers", "FILE", "-o", "o.toml"),
    "result": ("report", "FILE"),
    "identify": ("identify", "FILE"),
    "identify --update": ("identify", "p.nc", "--axis", "x", "--update", "FILE"),
    "servo": ("characterize", "--servo", "FILE", *M),
    "sheet": ("characterize", "--fit", "FILE", *M),
    "runs": ("characterize", "--runs", "FILE", *M),
    "log": ("characterize", "--runs", "runs.toml", *M),
    "tool": ("feed", "p.nc", *M, "--tool", "FILE", "--stock", "p.nc", "-o", "o.nc"),
    "stock": ("measure", "p.nc", *M, "--tool-diameter", "6mm", "--stock", "FILE"),
    "test cut": ("testcut", "fit", "p.nc", "--cut", "FILE"),
    "list": ("batch", "@FILE", *M, "-o", "out"),
}
TOML = ("machine", "study", "answers", "sheet", "runs", "tool")


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    (tmp_path / "p.nc").write_text(PROGRAM)
    return tmp_path


@contextlib.contextmanager
def no_wait() -> Iterator[None]:
    """Who waits for a pipe is told so; generous, since other work may run beside."""

    def waits(*_: object) -> None:
        pytest.fail("the command waits")

    before = signal.signal(signal.SIGALRM, waits)
    signal.alarm(60)
    try:
        yield
    finally:
        signal.alarm(0)
        signal.signal(signal.SIGALRM, before)


def words_of(kind: str, name: str, folder: Path) -> list[str]:
    (folder / "runs.toml").write_text(RUNS.format(name))
    return [word.replace("FILE", name) for word in READ[kind]]


@pytest.mark.parametrize("kind", READ)
def test_what_is_no_file_is_refused_at_once(kind: str, folder: Path) -> None:
    (folder / "folder").mkdir()
    os.mkfifo(folder / "pipe")
    (folder / "zero").symlink_to("/dev/zero")
    for name in ("folder", "pipe", "zero"):
        with no_wait():
            done = run(folder, *words_of(kind, name, folder))
        assert done.returncode == 2, done.stdout + done.stderr
        assert name in done.stdout + done.stderr
        assert done.stderr.count("\n") <= 3, done.stderr
    assert not (folder / "o.nc").exists() and not (folder / "o.toml").exists()


@pytest.mark.parametrize("bomb", RECORD_BOMBS)
def test_a_packed_or_nested_record_takes_no_gigabytes(bomb: str, folder: Path) -> None:
    name, made = RECORD_BOMBS[bomb]
    (folder / name).write_bytes(made())
    assert (folder / name).stat().st_size < 10_000_000
    for kind in ("servo", "log") if name.endswith(("z", "p")) else ("identify", "servo"):
        sound(command(folder, *words_of(kind, name, folder)), name)


@pytest.mark.parametrize("command_name", ["time", "check"])
def test_a_line_of_nothing_but_brackets_takes_no_time(command_name: str, folder: Path) -> None:
    (folder / "p.nc").write_bytes(b"%\nO1\nG21G90\n" + b"(" * 200_000 + b"\nM30\n%\n")
    sound(command(folder, command_name, "p.nc", *M), "p.nc:4", "(limit 250)")


def test_very_many_wrong_origins_are_counted(folder: Path) -> None:
    from shapegcode.machine import Machine

    wrong = "".join(f'axes.x.modes.1.k{number} = "measured"\n' for number in range(20_000))
    (folder / "a.toml").write_text(f"{Machine.builtin_text('vx500').partition('[origin]')[0]}\n[origin]\n{wrong}")
    sound(command(folder, *words_of("machine", "a.toml", folder)), "a.toml", "19900 further problems are not listed")


def test_a_machine_has_no_thousands_of_modes() -> None:
    mode = {"frequency_hz": 30.0, "damping_ratio": 0.01}
    machine = sg.Machine.load("vx500").with_values("axes.x.modes", [mode] * 200)
    assert len(machine.axes.x.modes) == 200
    with pytest.raises(sg.MachineError, match="200 or fewer"):
        machine.with_values("axes.x.modes", [mode] * 201)


@pytest.mark.parametrize("given", [None, b"G1", 3], ids=repr)
def test_what_names_no_file_is_an_error_of_arguments(given: object) -> None:
    with pytest.raises(sg.ArgumentError, match="a file name is needed, not "):
        sg.convert(given, "vx500")  # type: ignore[arg-type]


def test_more_set_points_than_there_is_room_for() -> None:
    """The slowest machine that a file can describe, and a long way."""
    slow = sg.Machine.load("vx500").with_values(
        {"axes.x.max_feed_mm_per_min": 1.0, "controller.interpolation_period_s": 1e-5}
    )
    program = "%\nO1\nG21G17G90G94\nG00X0.Y0.Z5.\nG01X900.F5000.\nM30\n%\n"
    with pytest.raises(sg.ArgumentError, match="set-points"):
        sg.simulate(program, slow)


@pytest.mark.parametrize("bomb", TOML_BOMBS)
def test_a_file_of_settings_takes_neither_minutes_nor_gigabytes(bomb: str, folder: Path) -> None:
    (folder / "a.toml").write_bytes(TOML_BOMBS[bomb])
    for kind in TOML if bomb == "400 digits" else ("machine",):
        sound(command(folder, *words_of(kind, "a.toml", folder)), "a.toml")


@pytest.mark.parametrize("digits", [25, 400, 5000])
@pytest.mark.parametrize("kind", ["result", "answers", "test cut", "servo"])
def test_long_integers_of_json_are_refused(kind: str, digits: int, folder: Path) -> None:
    (folder / "a.json").write_text(f'{{"Header": {{"CycleTimeMs": {"9" * digits}}}, "name": {"9" * digits}}}')
    done = run(folder, *words_of(kind, "a.json", folder))
    assert done.returncode == 2 and "a.json" in done.stderr and "digits" in done.stderr, done.stderr
    assert len(done.stderr) < 500


def test_the_limits_are_where_they_are_said_to_be(folder: Path) -> None:
    from shapegcode.io.data_file import DataFile, toml_tables

    path = folder / "a.json"
    for depth, fits in ((64, True), (65, False)):
        path.write_text("[" * depth + '"]]]] \\" [[[ \\\\"' + "]" * depth)
        refused = contextlib.nullcontext() if fits else pytest.raises(sg.RecordError, match="at most 64")
        with DataFile(path) as file, refused:
            file.json("a", file.read())
        nested = f"a = {'[' * (depth - 1)}{']' * (depth - 1)}"
        with contextlib.nullcontext() if fits else pytest.raises(ValueError, match="at most 64"):
            toml_tables(nested)
    largest = 2**63 - 1
    assert toml_tables(f"a = {largest}\nb = -{largest}") == {"a": largest, "b": -largest}
    path.write_text(f"[{largest}, -{largest}, 1e300, 12345678901234567890.5]")
    with DataFile(path) as file:
        assert file.json("a", file.read()) == [largest, -largest, 1e300, 12345678901234567890.5]
    # What a log really comes to is far from the ratio: 50 MB of numbers.
    draw = np.random.default_rng(1)
    assert len(zlib.compress(json.dumps(draw.normal(size=10_000).round(4).tolist()).encode())) * 10 > 70_000


def test_a_damaged_mat_file_does_not_crash_the_command(folder: Path) -> None:
    """SciPy 1.17 ends some of these by a segmentation fault: the zlib stream is whole, tags and sizes in it are not."""
    hz = np.arange(1.0, 200.0)
    savemat(folder / "a.mat", {"f": hz, "H": {"a": np.exp(1j * hz), "b": "text"}}, do_compression=True)
    whole = (folder / "a.mat").read_bytes()
    at = 128
    elements = []
    while at < len(whole):
        size = int.from_bytes(whole[at + 4 : at + 8], "little")
        elements.append(zlib.decompress(whole[at + 8 : at + 8 + size]))
        at += 8 + size
    draw = random.Random(3)
    for _ in range(8):
        body = b""
        for element in elements:
            data = bytearray(element)
            for _ in range(3):
                place = draw.randrange(0, min(len(data), 120), 4)
                data[place : place + 4] = draw.choice((2**31 - 1, 2**32 - 1, 0, 14)).to_bytes(4, "little")
            packed = zlib.compress(bytes(data))
            body += b"\x0f\0\0\0" + len(packed).to_bytes(4, "little") + packed
        (folder / "b.mat").write_bytes(whole[:128] + body)
        sound(command(folder, "identify", "b.mat"), "b.mat")


def test_a_mat_file_that_unpacks_to_gigabytes_is_refused(folder: Path) -> None:
    count = 200_000_000
    head = struct.pack("<IIIIII", 14, 8 * count + 56, 6, 8, 6, 0) + struct.pack("<IIII", 5, 8, 1, count)
    packer = zlib.compressobj()
    body = packer.compress(head + struct.pack("<IIQII", 1, 1, ord("f"), 9, 8 * count))
    body += b"".join(packer.compress(bytes(1 << 20)) for _ in range(8 * count >> 20)) + packer.flush()
    start = b"MATLAB 5.0 MAT-file".ljust(124) + b"\0\1IM"
    (folder / "a.mat").write_bytes(start + struct.pack("<II", 15, len(body)) + body)
    sound(command(folder, "identify", "a.mat"), "a.mat", "memory")


def test_signalling_nan_in_a_wav_is_a_sample_that_is_no_number(folder: Path) -> None:
    samples = np.sin(np.arange(4000) / 9.0).astype(np.float32)
    wavfile.write(folder / "a.wav", 4000, samples)
    data = bytearray((folder / "a.wav").read_bytes())
    data[-4:] = (0x7FA00001).to_bytes(4, "little")
    (folder / "a.wav").write_bytes(data)
    sound(command(folder, "identify", "a.wav"), "a.wav: sample 4000 of channel 1 is nan")


def test_a_wav_takes_no_memory_for_the_samples_that_its_header_promises(folder: Path) -> None:
    wavfile.write(folder / "a.wav", 4000, np.zeros(4000, np.float32))
    data = bytearray((folder / "a.wav").read_bytes())
    at = data.index(b"data")
    data[at + 4 : at + 8] = (0xFFFFFFF0).to_bytes(4, "little")
    (folder / "a.wav").write_bytes(data)
    sound(command(folder, "identify", "a.wav"), "a.wav")
