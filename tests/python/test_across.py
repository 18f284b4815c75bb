"""What modes move across the axis they were found along: taps, decays, frequency responses, a sweep, simulated by SciPy
and NumPy: a mode with the shape (x, y, z) answers along k to a push along y with the residue phi_y phi_k / m."""

from collections.abc import Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import shapegcode as sg
from command import run
from shaken_axis import Logger, ShakenMode, logged, shaken
from shapegcode.errors import RecordError
from shapegcode.identification.known_command import known_command
from shapegcode.identification.result import Identification
from shapegcode.identification.sweep_program import write_sweep
from shapegcode.io.units import FloatArray
from tap_truth import TrueMode, tap
from test_frequency_response import closed_form

Shape = tuple[float, float, float]
AXES = "xyz"
Structure = Sequence[tuple[TrueMode, Shape]]
MODES: list[tuple[TrueMode, Shape]] = [
    (TrueMode(31.0, 0.02, 80.0), (0.2, 1.0, 0.3)),
    (TrueMode(57.0, 0.03, 60.0), (0.0, 1.0, -0.6)),
    (TrueMode(120.0, 0.015, 100.0), (-0.4, 0.7, 0.1)),
]
READ = sg.ReadOptions(axis="y")


def hit(modes: Structure, seed: int, *, axes: str = AXES, snr_db: float = 35.0) -> list[sg.Record]:
    """A tap along Y on a sensor of three axes."""
    rng = np.random.default_rng(seed)
    peak_n = float(rng.uniform(300.0, 700.0))
    records = []
    for letter in axes:
        k = AXES.index(letter)
        seen = [replace(mode, mass_kg=mode.mass_kg / (shape[1] * shape[k])) for mode, shape in modes if shape[k]]
        clean = tap(seen or [TrueMode(50.0, 0.02, 1e12)], rng, peak_n=peak_n)
        level = 10.0 ** (-snr_db / 20.0)
        noise = level * np.std(tap([replace(m, mass_kg=m.mass_kg / s[1] ** 2) for m, s in modes], rng).response)
        force = clean.force_n + 0.001 * peak_n * np.random.default_rng(seed).standard_normal(len(clean.force_n))
        response = clean.response + noise * rng.standard_normal(len(force))
        records.append(replace(clean, source=f"tap{seed}", response=response, force_n=force, axis=letter))
    return records


def along(records: Sequence[sg.Record], letter: str) -> list[sg.Record]:
    return [record for record in records if record.axis == letter]


def check(found: Identification, modes: Structure, within: float = 0.02) -> None:
    assert len(found.modes) == len(modes), found
    for mode, (truth, shape) in zip(found.modes, modes, strict=True):
        assert mode.frequency_hz.value == pytest.approx(truth.frequency_hz, rel=0.005)
        for estimate, share in zip(mode.moves, shape, strict=True):
            assert estimate.value == pytest.approx(share / shape[1], abs=within)


def write(path: Path, records: Sequence[sg.Record]) -> Path:
    first = records[0]
    columns: dict[str, FloatArray] = {"time [s]": first.period_s * np.arange(len(first.response))}
    if first.force_n is not None:
        columns["force [N]"] = first.force_n
    columns |= {f"acc{(each.axis or '').upper()} [m/s^2]": each.response for each in records}
    np.savetxt(path, np.array(list(columns.values())).T, "%.8g", ",", header=",".join(columns), comments="")
    return path


@pytest.fixture(scope="module")
def files(tmp_path_factory: pytest.TempPathFactory) -> list[Path]:
    folder = tmp_path_factory.mktemp("taps")
    return [write(folder / f"tap{seed}.csv", hit(MODES, seed)) for seed in (1, 2, 3)]


def test_taps_with_a_sensor_of_three_axes(files: list[Path]) -> None:
    found = sg.identify(files, READ, across=True)
    check(found, MODES)
    assert all(mode.moves is None for mode in sg.identify(files, READ).modes)


def test_a_sensor_that_is_turned_between_taps() -> None:
    seeds = [(letter, 5 * rank + k) for rank, letter in enumerate(AXES) for k in range(3)]
    records = [record for letter, seed in seeds for record in hit(MODES, seed, axes=letter)]
    found = sg.identify(along(records, "y"), across=[*along(records, "x"), *along(records, "z")])
    check(found, MODES, within=0.05)


@pytest.mark.slow
def test_intervals_hold_the_truth() -> None:
    held = total = 0
    for seed in range(100, 112):
        rng = np.random.default_rng(seed)
        modes = [(mode, (float(rng.normal()), shape[1], float(rng.normal()))) for mode, shape in MODES]
        records = [record for k in range(3) for record in hit(modes, 10 * seed + k, snr_db=25.0)]
        found = sg.identify(along(records, "y"), across=records)
        for mode in found.modes:
            shape = min((abs(truth.frequency_hz - mode.frequency_hz.value), shape) for truth, shape in modes)[1]
            for k, estimate in ((0, mode.moves.x), (2, mode.moves.z)):
                held += estimate.low <= shape[k] / shape[1] <= estimate.high
                total += 1
    assert total >= 60
    assert held >= 0.9 * total, f"{held} of {total}"


def test_a_decay_of_all_axes(files: list[Path], tmp_path: Path) -> None:
    whole = hit(MODES, 7)
    stop = [replace(record, force_n=None, response=record.response[90:]) for record in whole]
    found = sg.identify(write(tmp_path / "stop.csv", stop), READ, across=True)
    check(found, MODES, within=0.05)
    with pytest.raises(RecordError, match="one record of all axes"):
        sg.identify(along(stop, "y"), across=[replace(record, source="other") for record in along(stop, "z")])


def responses(modes: Structure) -> dict[str, sg.FrequencyResponse]:
    """Accelerance over a push along Y, with noise."""
    hertz, rng = np.arange(5.0, 300.0, 0.25), np.random.default_rng(3)
    found = {}
    for k, letter in enumerate(AXES):
        seen = [replace(mode, mass_kg=mode.mass_kg / (shape[1] * shape[k])) for mode, shape in modes if shape[k]]
        noise = 1e-3 * (rng.standard_normal(len(hertz)) + 1j * rng.standard_normal(len(hertz)))
        found[letter] = sg.FrequencyResponse(
            letter, hertz, closed_form(seen, hertz, "acceleration") + noise, axis=letter
        )
    return found


@pytest.mark.parametrize("sign", [1.0, -1.0], ids=["along the arrow", "against it"])
def test_frequency_responses(sign: float) -> None:
    lines = {letter: replace(each, response=sign * each.response) for letter, each in responses(MODES).items()}
    check(sg.identify([lines["y"]], across=[lines["x"], lines["z"]]), MODES)


def test_a_sweep_beside_a_sensor_of_three_axes(tmp_path: Path) -> None:
    machine, program = sg.Machine.load("vx500"), tmp_path / "SWEEP.NC"
    write_sweep(program, machine, "y", seconds=40.0)
    command = known_command(program, machine)
    modes, rocking = [ShakenMode(0.5, 23.0, 0.02), ShakenMode(0.3, 46.0, 0.03)], {23.0: (0.1, -0.4), 46.0: (0.0, 0.8)}
    channels = {"y": shaken(command.position * 1e3, command.period_s, modes)}
    times = channels["y"][0]
    carried = shaken(command.position * 1e3, command.period_s, [])[1]
    for k, letter in enumerate("xz"):
        motion = np.zeros(len(times))
        for mode in modes:
            own = shaken(command.position * 1e3, command.period_s, [mode])[1] - carried
            motion += rocking[mode.frequency_hz][k] * own
        channels[letter] = times, motion
    samples = {letter: logged(*channel, Logger(), 5 + AXES.index(letter)) for letter, channel in channels.items()}
    clock = samples["y"][0]
    records = [sg.Record("phone", float(clock[1]), samples[letter][1], axis=letter) for letter in AXES]
    found = sg.identify(write(tmp_path / "phone.csv", records), sweep=program, machine=machine, across=True)
    assert [mode.frequency_hz.value for mode in found.modes] == pytest.approx([23.0, 46.0], rel=0.005)
    for mode, (x, z) in zip(found.modes, rocking.values(), strict=True):
        assert mode.moves is not None and mode.moves.x is not None and mode.moves.z is not None
        assert mode.moves.x.value == pytest.approx(x, abs=0.03)
        assert mode.moves.z.value == pytest.approx(z, abs=0.03)


def moves(machine: sg.Machine) -> list[Mapping[str, float] | None]:
    modes = sorted(machine.axes.y.modes, key=lambda mode: mode.frequency_hz)
    return [None if mode.moves is None else mode.moves.model_dump() for mode in modes]


def test_into_the_machine_file_and_back(files: list[Path], tmp_path: Path) -> None:
    file = tmp_path / "mine.toml"
    file.write_text(sg.Machine.load("vx500").to_toml(short=True))
    names = [str(each) for each in files]
    done = run(tmp_path, "identify", *names, "--axis", "y", "--update", file, "--keep-modes", "x", "--across")
    assert done.returncode == 0, done.stderr
    assert "mode shapes, relative" in done.stdout
    said = moves(sg.Machine.load(file))
    assert said[0] is not None and said[0]["z"] == pytest.approx(0.3, abs=0.01)
    assert said[1] is not None and said[1]["x"] == 0.0  # not told from nothing
    once = file.read_text()
    run(tmp_path, "identify", *names, "--axis", "y", "--update", file, "--keep-modes", "x", "--across")
    assert file.read_text() == once
    # A tap along one axis keeps what is known of the others; a sensor that sees nothing there takes it out.
    run(tmp_path, "identify", *names, "--axis", "y", "--update", file, "--keep-modes", "x")
    assert moves(sg.Machine.load(file)) == said
    still = [(mode, (0.0, shape[1], 0.0)) for mode, shape in MODES]
    records = [record for seed in (1, 2, 3) for record in hit(still, seed)]
    update = sg.update_machine(file, sg.identify(along(records, "y"), across=records), keep_modes="x")
    assert moves(update.machine) == [{"x": 0.0, "y": 1.0, "z": 0.0}] * 3


@pytest.mark.parametrize(
    ("options", "words"),
    [
        (["--axis", "y", "--across", "{alone}"], "no response along X or Z"),
        (["--across"], "which|--axis|axis is x"),
        (["--axis", "y", "--across", "none.csv"], "none.csv"),
    ],
)
def test_what_cannot_tell_is_refused(files: list[Path], tmp_path: Path, options: list[str], words: str) -> None:
    alone = write(tmp_path / "alone.csv", along(hit(MODES, 4), "y"))
    done = run(tmp_path, "identify", str(files[0]), *(each.format(alone=alone) for each in options))
    assert done.returncode == 2
    said = done.stdout + done.stderr
    assert any(word in said for word in words.split("|")), said


def pushed_back(records: Sequence[sg.Record]) -> list[sg.Record]:
    """The hammer's force has no direction: pushed against the arrow, everything moves the other way."""
    return [replace(record, response=-record.response) for record in records]


@pytest.mark.parametrize("count", [1, 3])  # the first moment tells the sign of one mode, the fit that of several
def test_a_hit_against_the_arrow_has_the_same_signs(count: int) -> None:
    records = [record for seed in (1, 2, 3) for record in pushed_back(hit(MODES[:count], seed))]
    found = sg.identify(along(records, "y"), across=records)
    check(found, MODES[:count])
    assert any("sign is reversed" in warning for warning in found.warnings)


def in_one_file(hits: Sequence[Sequence[sg.Record]], source: str) -> list[sg.Record]:
    """Hits one after the other."""
    joined = []
    for parts in zip(*hits, strict=True):
        forces = [part.force_n for part in parts if part.force_n is not None]
        values = np.concatenate([part.response for part in parts])
        joined.append(replace(parts[0], source=source, response=values, force_n=np.concatenate(forces)))
    return joined


def bounced(records: Sequence[sg.Record], after: int = 500) -> list[sg.Record]:
    """With a second pulse of 60 %."""

    def twice(values: FloatArray) -> FloatArray:
        return np.asarray(values + 0.6 * np.concatenate((np.zeros(after), values[:-after])))

    forces = [twice(record.force_n) for record in records if record.force_n is not None]
    return [
        replace(record, response=twice(record.response), force_n=force)
        for record, force in zip(records, forces, strict=True)
    ]


def test_several_hits_in_one_file_of_which_one_is_refused(tmp_path: Path) -> None:
    hits = [hit(MODES, 11), bounced(hit(MODES, 12)), hit(MODES, 13)]
    found = sg.identify(write(tmp_path / "three.csv", in_one_file(hits, "three")), READ, across=True)
    check(found, MODES)
    assert [use.used for use in found.records] == [True, True, False]


def test_the_other_axes_of_a_refused_hit_do_not_count(files: list[Path], tmp_path: Path) -> None:
    twice = write(tmp_path / "twice.csv", bounced(hit(MODES, 2)))
    found = sg.identify([files[0], twice, files[2]], READ, across=True)
    check(found, MODES, within=0.005)
    assert [use.used for use in found.records] == [True, True, False]


@pytest.mark.parametrize(
    ("changes", "said"),
    [
        ({"source": "stop", "force_n": None}, r"stop: no force, but tap1 has one"),
        ({"quantity": "velocity"}, r"velocity.*acceleration"),
    ],
)
def test_other_hits_need_their_force_and_the_same_quantity(changes: dict[str, Any], said: str) -> None:
    others = [replace(record, **changes) for record in along(hit(MODES, 2), "z")]
    with pytest.raises(RecordError, match=said):
        sg.identify(along(hit(MODES, 1), "y"), across=others)


@pytest.mark.parametrize(("share", "words"), [(0.0, "is the sensor connected"), (0.3, "overload")])
def test_a_dead_or_clipped_channel_is_refused(share: float, words: str) -> None:
    records = hit(MODES, 1)
    limit = share * float(np.max(np.abs(records[2].response)))
    records[2] = replace(records[2], response=np.clip(records[2].response, -limit, limit))
    with pytest.raises(RecordError, match=words):
        sg.identify(along(records, "y"), across=records)


def test_why_there_is_no_mode_comes_before_what_is_missing_across(files: list[Path], tmp_path: Path) -> None:
    done = run(tmp_path, "identify", str(files[0]), "--axis", "y", "--across", "--stops")
    assert done.returncode == 2
    assert "contains a force" in done.stdout


def test_the_next_step_looks_across_too(files: list[Path], tmp_path: Path) -> None:
    done = run(tmp_path, "identify", str(files[0]), "--axis", "y", "--across")
    assert f"next: shapegcode identify {files[0]} --axis y --across --update mine.toml" in " ".join(done.stdout.split())


@pytest.mark.parametrize(("options", "word"), [({"stops": True}, "--stops"), ({"start_s": 0.1}, "--start")])
def test_a_frequency_response_has_no_stops(options: dict[str, Any], word: str) -> None:
    with pytest.raises(sg.ArgumentError, match=f"{word} has no effect"):
        sg.identify([responses(MODES)["y"]], **options)


def test_the_phase_of_next_to_nothing_is_not_told() -> None:
    lines = responses(MODES)
    lines["x"] = replace(lines["x"], response=0.004j * lines["y"].response)
    found = sg.identify([lines["y"]], across=[lines["x"], lines["z"]])
    assert not any("out of phase" in note for note in found.notes)
