"""What is wrong with the input is said once, with its place, and nothing is left behind."""

import errno
import os
import random
import re
import resource
import subprocess
from pathlib import Path

import pytest
from hypothesis import HealthCheck, given, settings, strategies as st

import shapegcode as sg
from acceptance import PROGRAMS, SAMPLES, machine_with
from command import COMMAND, run, run_process
from shapegcode.cli import main

REJECTED = Path(__file__).parents[1] / "rejected"
CASES = sorted(path.stem for path in REJECTED.glob("*.nc"))
PLAIN = machine_with()
GOOD = "%\nO1\nG21G17G90G94\nG0X0Y0Z0\nG1X10.F600\nY10.\nG0Z50.\nM30\n%\n"


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    (tmp_path / "good.nc").write_text(GOOD)
    return tmp_path


def refused(done: subprocess.CompletedProcess[str], *parts: str) -> None:
    """Exit code 2, one line on standard error, nothing on standard output."""
    assert done.returncode == 2, done.stdout + done.stderr
    assert done.stdout == ""
    assert "Traceback" not in done.stderr
    lines = done.stderr.splitlines()
    assert len(lines) == 1, done.stderr
    assert lines[0].startswith("shapegcode: ")
    for part in parts:
        assert part in lines[0]


@pytest.mark.parametrize("name", CASES)
def test_rejected_program(
    name: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    program = REJECTED / f"{name}.nc"
    (tmp_path / program.name).write_bytes(program.read_bytes())
    monkeypatch.chdir(tmp_path)
    machine = ["-m", "vx500"]
    if name.startswith("macro_endless_"):
        machine += ["--set", "controller.max_program_steps=1000"]
    convert = ["convert", program.name, *machine, "-o", "out.nc", "--compensation", "expand"]
    for words in (convert, ["simulate", program.name, *machine]):
        assert main(words) == 2
        out, err = capsys.readouterr()
        assert out == ""
        assert err == (REJECTED / f"{name}.expected").read_text()
        assert re.match(rf"shapegcode: {name}\.nc:[1-9]\d*:[1-9]\d*: \S", err)
    assert os.listdir(tmp_path) == [program.name]


def test_every_rejected_program_has_its_message_and_no_message_is_left_over() -> None:
    assert sorted(path.stem for path in REJECTED.glob("*.expected")) == CASES
    assert len(CASES) >= 200


def test_rejected_program_as_a_process(tmp_path: Path) -> None:
    (tmp_path / "arc.nc").write_bytes((REJECTED / "arc_off_radius.nc").read_bytes())
    refused(
        run_process(tmp_path, "convert", "arc.nc", "-m", "vx500", "-o", "out.nc"), "arc.nc:4:7:", "2.0000", "0.0100"
    )
    assert os.listdir(tmp_path) == ["arc.nc"]


def test_absolute_centres_are_hinted_at() -> None:
    text = (PROGRAMS / "BOTTLE.NC").read_bytes()
    with pytest.raises(sg.ProgramError, match=r'set input\.arc_centre = "absolute"') as caught:
        sg.Program.from_text(text, machine_with(), source="BOTTLE.NC")
    assert caught.value.line == 12
    assert caught.value.column > 1


REFUSED = [
    ("check no.nc", "no.nc: no such file"),
    ("check good.nc -m vx501", "no built-in machine"),
    ("check good.nc --json good.nc", "would overwrite"),
    ("check good.nc --program P1", "must be a program number"),
    ("simulate good.nc --lines 90-99", "1-9"),
    ("simulate good.nc --lines 3-10", "1-9"),
    ("simulate good.nc --lines 1-2", "no motion there"),
    ("simulate good.nc --lines 9-3", "first to last"),
    ("simulate good.nc --lines 0", "first to last"),
    ("simulate good.nc --every 0", "1 or more"),
    ("simulate good.nc --plant other", "--plant"),
    ("simulate good.nc --csv a --npz a", "a would overwrite a"),
    ("simulate good.nc --npz a --json a", "a would overwrite a"),
    ("simulate good.nc --csv good.nc", "good.nc would overwrite good.nc"),
    ("simulate good.nc --npz -", "standard output"),
    ("simulate good.nc --csv - --json -", "standard output"),
    ("simulate good.nc --csv nowhere/m.csv", "nowhere"),
    ("simulate good.nc --npz nowhere/m.npz", "nowhere"),
    ("convert good.nc -o out.nc --only 900-950", "has lines 1 to 9"),
    ("convert good.nc -o out.nc --leave 1-2", "no cut that can be shaped there"),
    ("convert good.nc -o out.nc --only 5-2", "first to last"),
    ("convert good.nc -o out.nc --only x", "first to last"),
    *(
        (f"convert good.nc -o out.nc {option} {value}", "time")
        for option in ("--max-time-increase", "--max-cut-time-increase")
        for value in ("0", "-3", "nan")
    ),
]


@pytest.mark.parametrize(("words", "said"), REFUSED, ids=[words for words, _ in REFUSED])
def test_what_a_command_cannot_do_is_refused_and_nothing_is_written(folder: Path, words: str, said: str) -> None:
    machine = () if "-m" in words.split() else ("-m", "vx500")
    done = run(folder, *words.split(), *machine)
    assert (done.returncode, done.stdout) == (2, "")
    assert said in done.stderr.splitlines()[-1]
    assert os.listdir(folder) == ["good.nc"]


@pytest.mark.parametrize(
    ("program", "output", "said"),
    [
        ("nothing.nc", "out.nc", "nothing.nc: no such file"),
        (".", "out.nc", ".: "),
        ("/proc/self/mem", "out.nc", "/proc/self/mem: "),
        ("good.nc", "nowhere/out.nc", "nowhere/out.nc: the folder nowhere does not exist"),
        ("good.nc", "nowhere/deep/out.nc", "nowhere/deep/out.nc: the folder nowhere/deep does not exist"),
        ("good.nc", ".", "."),
        ("good.nc", "/", "/"),
        ("good.nc", "/proc/out.nc", "/proc/out.nc"),
        ("good.nc", "out.nc --json out.nc", "out.nc"),
        # No output is left where a second result cannot be written.
        ("good.nc", "out.nc --json nowhere/report.json", "nowhere/report.json"),
        ("good.nc", "out.nc --plots good.nc", "good.nc"),
        *(("good.nc", f"out.nc -m {machine}", machine) for machine in ("nothing.toml", "vx501", ".")),
    ],
)
def test_files_that_are_none(folder: Path, program: str, output: str, said: str) -> None:
    refused(run(folder, "convert", program, "-m", "vx500", "-o", *output.split()), said)
    assert os.listdir(folder) == ["good.nc"]


@pytest.mark.parametrize("link", ["same", "symbolic", "hard"])
@pytest.mark.parametrize("option", ["-o", "--json"])
def test_input_is_never_overwritten(folder: Path, link: str, option: str) -> None:
    target = "good.nc" if link == "same" else "link.nc"
    if link == "symbolic":
        (folder / target).symlink_to("good.nc")
    elif link == "hard":
        (folder / target).hardlink_to(folder / "good.nc")
    words = ["-o", target] if option == "-o" else ["-o", "out.nc", "--json", target]
    refused(run(folder, "convert", "good.nc", "-m", "vx500", *words), target)
    assert (folder / "good.nc").read_text() == GOOD
    assert not (folder / "out.nc").exists()


def test_suffix_of_a_failed_output_may_not_hit_the_input(folder: Path) -> None:
    (folder / "good.nc").rename(folder / "a.out-of-tolerance")
    refused(run(folder, "convert", "a.out-of-tolerance", "-m", "vx500", "-o", "a"), "a.out-of-tolerance")
    assert (folder / "a.out-of-tolerance").read_text() == GOOD


def small_files() -> None:
    resource.setrlimit(resource.RLIMIT_FSIZE, (1000, 1000))


@pytest.mark.parametrize("words", ["convert long.nc -o", "simulate long.nc --csv", "simulate long.nc --npz"])
@pytest.mark.parametrize("existing", [False, True])
def test_disk_full_in_the_middle_of_the_output(folder: Path, existing: bool, words: str) -> None:
    """The write fails half-way: no half file, no temporary; what stood there before stays."""
    (folder / "long.nc").write_text(GOOD.replace("Y10.\n", "".join(f"Y{k}.\nX{k}.\n" for k in range(30))))
    if existing:
        (folder / "out").write_text("as it was")
    before = sorted(os.listdir(folder))
    done = run_process(folder, *words.split(), "out", "-m", "vx500", limit=small_files)
    refused(done, "shapegcode: out: ", os.strerror(errno.EFBIG))
    assert sorted(os.listdir(folder)) == before
    if existing:
        assert (folder / "out").read_text() == "as it was"


def test_full_standard_output(folder: Path) -> None:
    with open("/dev/full", "w") as full:
        done = subprocess.run(
            [COMMAND, "simulate", "good.nc", "-m", "vx500", "--json", "-"],
            cwd=folder, stdout=full, stderr=subprocess.PIPE, text=True, check=False,
        )  # fmt: skip
    assert done.returncode == 2
    assert os.strerror(errno.ENOSPC) in done.stderr
    assert "Traceback" not in done.stderr


@pytest.mark.parametrize(
    ("old", "new", "parts"),
    [
        ("max_feed_mm_per_min = 15000.0", "max_feed_mm_per_min = nan", ("max_feed_mm_per_min = nan", "finite")),
        ("max_acceleration_mm_s2 = 5000.0", "max_acceleration_mm_s2 = -1.0", ("= -1.0", "must be 1 or more")),
        ("damping_ratio = 0.02", "damping_ratio = 1.5", ("damping_ratio = 1.5", "1")),
        ('name = "VX500"', "name = ", ("machine.toml:",)),
        ('name = "VX500"', 'nmae = "VX500"', ("nmae",)),
    ],
)
def test_bad_machine_file(folder: Path, old: str, new: str, parts: tuple[str, ...]) -> None:
    assert run(folder, "machine", "init", "--full").returncode == 0
    text = (folder / "machine.toml").read_text()
    assert old in text
    (folder / "machine.toml").write_text(text.replace(old, new, 1))
    done = run(folder, "convert", "good.nc", "-m", "machine.toml", "-o", "out.nc")
    assert done.returncode == 2
    assert done.stdout == ""
    assert "Traceback" not in done.stderr
    assert all(line.startswith("shapegcode: machine.toml") for line in done.stderr.splitlines())
    for part in parts:
        assert part in done.stderr
    assert sorted(os.listdir(folder)) == ["good.nc", "machine.toml"]


@pytest.mark.parametrize(
    ("words", "parts"),
    [
        # 200 Hz on a 5 ms grid: one whole turn per block, z = 1.
        ("--set axes.x.modes=[{frequency_hz=200,damping_ratio=0}] --block-period 5ms", ("200 Hz", "5 ms", "limit")),
        ("--block-period 7.5ms", ("7.5 ms", "multiple", "1 ms")),
        ("--block-period 2ms", ("2 ms", "block time 5 ms")),
        ("--set axes.x.modes=[] --set axes.y.modes=[]", ("mode",)),
        ("--set shaping.max_duration_s=0.001", ("1 ms",)),
        ("--set controller.interpolation_period_s=nan", ("interpolation_period_s = nan", "finite")),
        ("--set nothing", ("nothing", "KEY=VALUE")),
        ("--set no.such.key=1", ("no",)),
        ("--set controller=1", ("controller = 1", "table")),
        ("--set axes.x.max_feed_mm_per_min=fast", ('max_feed_mm_per_min = "fast"', "number")),
    ],
)
def test_bad_setting(folder: Path, words: str, parts: tuple[str, ...]) -> None:
    refused(run(folder, "convert", "good.nc", "-m", "vx500", "-o", "out.nc", *words.split()), *parts)
    assert os.listdir(folder) == ["good.nc"]


@pytest.mark.parametrize(
    "words",
    [
        *(("--arc-feed", value) for value in ("0", "101%", "nan", "much")),
        *(("--block-period", value) for value in ("0", "nan", "-5ms", "5min")),
    ],
)
def test_bad_argument(folder: Path, words: tuple[str, str]) -> None:
    done = run(folder, "convert", "good.nc", "-m", "vx500", "-o", "out.nc", f"{words[0]}={words[1]}")
    assert done.returncode == 2
    assert done.stderr.splitlines()[-1].startswith(f"shapegcode convert: error: argument {words[0]}: '{words[1]}'")
    assert os.listdir(folder) == ["good.nc"]


def test_a_cut_of_months_is_refused(folder: Path) -> None:
    """Its samples would fill any memory."""
    (folder / "slow.nc").write_text(GOOD.replace("X10.F600", "X90000.F1.5"))
    refused(run(folder, "convert", "slow.nc", "-m", "vx500", "-o", "out.nc"), "slow.nc:")
    assert not (folder / "out.nc").exists()


def survives(data: bytes, machine: sg.Machine) -> str:
    """Read and convert; only the family of expected errors may come out. Returns what happened."""
    try:
        program = sg.Program.from_text(data, machine, source="fuzz.nc")
    except sg.ProgramError as error:
        assert re.match(r"fuzz\.nc:[1-9]\d*:[1-9]\d*: \S", str(error)), str(error)
        return "rejected"
    try:
        sg.convert(program, machine)
    except sg.ShapegcodeError as error:
        # Read, but not convertible: only for a reason that names the place; a round trip that fails is a defect.
        assert "fuzz.nc:" in str(error), str(error)
        return "refused"
    return "converted"


def mutations(seed: int, count: int, longest: int) -> list[bytes]:
    """The samples, cut to some hundred bytes or lines, with a few bytes changed, dropped, doubled or swapped."""
    dice = random.Random(seed)
    out = []
    alphabet = b"%()/;.-+#[]=,NGXYZIJKRFSTMHDPQLO0123456789 \n\r\t\x00\xff"
    while len(out) < count:
        data = bytearray((PROGRAMS / dice.choice(SAMPLES)).read_bytes())
        lines = data.split(b"\n")
        if len(data) > longest:
            first = dice.randrange(len(lines) - 20)
            head, tail = lines[:12], lines[-6:]
            data = bytearray(b"\n".join([*head, *lines[first : first + dice.randrange(5, 60)], *tail]))
        for _ in range(dice.choice((1, 1, 2, 3, 8))):
            at = dice.randrange(len(data))
            match dice.randrange(5):
                case 0:
                    data[at] = dice.choice(alphabet)
                case 1:
                    del data[at : at + dice.randrange(1, 6)]
                case 2:
                    data[at:at] = bytes(dice.choice(alphabet) for _ in range(dice.randrange(1, 4)))
                case 3:
                    other = dice.randrange(len(data))
                    data[at], data[other] = data[other], data[at]
                case _:
                    data[at:at] = data[at : at + dice.randrange(1, 40)]
            if not data:
                break
        out.append(bytes(data))
    return out


def fuzz(seed: int, count: int) -> None:
    machine = machine_with({"controller.calculator_decimal_point": True, "controller.arc_radius_tolerance_mm": 1000.0})
    seen: dict[str, int] = {}
    for data in mutations(seed, count, 4000):
        try:
            what = survives(data, machine)
        except Exception as error:
            error.add_note(f"program: {data!r}")
            raise
        seen[what] = seen.get(what, 0) + 1
    # The mutations are neither all nonsense nor all harmless.
    assert seen["rejected"] > count / 20
    assert seen["converted"] > count / 20


@pytest.mark.slow
@pytest.mark.parametrize(("seed", "count"), [(1, 50), (2, 100)])
def test_changed_bytes_never_crash(seed: int, count: int) -> None:
    fuzz(seed, count)


@settings(max_examples=200, suppress_health_check=list(HealthCheck))
@given(st.binary(max_size=300))
def test_binary_never_crashes(data: bytes) -> None:
    survives(data, PLAIN)


LETTERS = st.sampled_from(
    [*"GGGGXXYYZIJKRFNMSTHDPQLO(%/", "G1", "G2", "G3", "G0", "G91", "G90", "G18", "\n", "\n", " "]
)
NUMBERS = (
    st.integers(0, 120).map(str) | st.floats(-100, 100).map(lambda v: f"{v:.3f}") | st.sampled_from(["", "-", "."])
)
WORDS = st.lists(st.tuples(LETTERS, NUMBERS), max_size=60)


def words_survive(words: list[tuple[str, str]]) -> None:
    body = "".join(a + b for a, b in words)
    survives(f"%\nG21G17G90G94\nG0X0Y0Z0F500.\n{body}\nM30\n%\n".encode(), PLAIN)


@settings(max_examples=60, suppress_health_check=list(HealthCheck))
@given(WORDS)
def test_words_at_random_never_crash(words: list[tuple[str, str]]) -> None:
    words_survive(words)


MANY = settings(max_examples=200, suppress_health_check=list(HealthCheck))
test_many_words_at_random_never_crash = pytest.mark.slow(MANY(given(WORDS)(words_survive)))
