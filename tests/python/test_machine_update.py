"""Identified modes in a machine file: what changes, what stays byte for byte, what is refused."""

import difflib
import tomllib
from pathlib import Path

import numpy as np
import pytest
import scipy.linalg

from shapegcode._core import ArgumentError
from shapegcode.errors import MachineError
from shapegcode.identification.result import Estimate, Identification, IdentifiedMode, Sweep
from shapegcode.identification.update import update_machine, update_modes
from shapegcode.machine import Machine

VX500 = Machine.builtin_text("vx500")


def estimate(value: float, percent: float) -> Estimate:
    return Estimate(value, value * (1.0 - percent / 100.0), value * (1.0 + percent / 100.0))


def tap(frequency_hz: float, *, percent: float = 0.05, mass: float | None = 20.0, refusal: str = "") -> IdentifiedMode:
    return IdentifiedMode(
        estimate(frequency_hz, percent),
        estimate(0.031, 4.0),
        None if mass is None else estimate(mass, 2.0),
        None if mass is None else estimate(1.0, 3.0),
        None if mass is None else estimate(1.0, 3.0),
        refusal,
    )


def changed(before: str, after: str) -> tuple[list[str], list[str]]:
    """Lines that went, and lines that came."""
    delta = list(difflib.ndiff(before.splitlines(), after.splitlines()))
    return [line[2:] for line in delta if line[0] == "-"], [line[2:] for line in delta if line[0] == "+"]


def test_a_mode_takes_the_table_of_the_one_it_replaces() -> None:
    update = update_modes(VX500, "x", [tap(46.7)], source="tap test tap.csv, 3 taps")
    gone, come = changed(*(each.partition("\n[origin]")[0] for each in (VX500, update.text)))
    assert gone == [
        "frequency_hz = 46.0  # measured (paper 000: accelerometer after a rapid stop, peak of the spectrum)",
        "damping_ratio = 0.02  # assumed: the paper gives none; 0.02 reproduces its table of orbit errors",
        "# frequency_uncertainty_percent = ...  # not known",
        "# damping_uncertainty_percent = ...  # not known",
        "# mass_kg = ...  # not known",
        "# mass_uncertainty_percent = ...  # not known",
        "# source = ...  # not known",
    ]
    assert come == [
        "frequency_hz = 46.7  # 95 %: 46.67665 ... 46.72335",
        "damping_ratio = 0.031  # 95 %: 0.02976 ... 0.03224",
        "frequency_uncertainty_percent = 0.05006  # half of the 95 % interval",
        "damping_uncertainty_percent = 4.001  # half of the 95 % interval",
        "mass_kg = 20.0  # 95 %: 19.6 ... 20.4",
        "mass_uncertainty_percent = 2.001  # half of the 95 % interval",
        'source = "tap test tap.csv, 3 taps"',
    ]
    (mode,) = update.machine.axes.x.modes
    assert (mode.frequency_hz, mode.damping_ratio, mode.participation) == (46.7, 0.031, 1.0)
    assert update.machine.axes.y == Machine.load("vx500").axes.y
    note, unknown = update.notes
    assert unknown.startswith("no mode of Z is known")
    assert note == "46.7 Hz replaces 46.0 Hz, which keeps participation 1.0"


@pytest.mark.parametrize("axis", ["x", "y", "z"])
@pytest.mark.parametrize("name", Machine.builtin_names())
def test_twice_is_once_and_the_other_axes_stay(name: str, axis: str) -> None:
    modes = [tap(30.0), tap(47.0, mass=None), tap(120.0)]
    before = Machine.builtin_text(name)
    once = update_modes(before, axis, modes, source="s")
    twice = update_modes(once.text, axis, modes, source="s")
    assert twice.text == once.text
    wanted, found = tomllib.loads(before), tomllib.loads(once.text)
    said, here = (each.pop("origin")["axes"] for each in (wanted, found))
    assert here[axis]["modes"]["2"]["frequency_hz"].startswith("measured: 95 %: ")
    assert {key: said[key] for key in said if key != axis} == {key: here[key] for key in here if key != axis}
    assert sorted(each["frequency_hz"] for each in found["axes"][axis].pop("modes")) == [30.0, 47.0, 120.0]
    wanted["axes"][axis].pop("modes", None)
    assert found == wanted
    # no comment line goes but those of the table that went, and the placeholders whose place was taken
    gone, _ = changed(before, once.text)
    assert all(" = " in line or line.lstrip("# ").startswith("[[") or axis == "y" or not line for line in gone), gone


def test_uncertainties_are_never_rounded_down() -> None:
    for percent in (1e-5, 0.0123456, 0.05, 1.0, 12.34567):
        mode = tap(45.9876543219, percent=percent)
        (written,) = update_modes(VX500, "x", [mode], source="s").machine.axes.x.modes
        assert written.frequency_hz == pytest.approx(45.9876543219, rel=5e-7)
        half = written.frequency_hz * written.frequency_uncertainty_percent / 100.0
        assert written.frequency_hz - half <= mode.frequency_hz.low
        assert written.frequency_hz + half >= mode.frequency_hz.high
        assert written.frequency_uncertainty_percent == pytest.approx(percent, rel=2e-3, abs=1e-4)


def stated(line: str) -> str:
    return VX500.replace("# frequency_uncertainty_percent = ...  # not known", line, 1)


def test_a_band_that_somebody_stated_wider_stays() -> None:
    line = "frequency_uncertainty_percent = 5  # over the table's travel"
    wide = update_modes(stated(line), "x", [tap(46.7)], source="s")
    assert line in wide.text
    assert wide.machine.axes.x.modes[0].frequency_uncertainty_percent == 5.0
    assert "frequency_uncertainty_percent = 5, wider than the measured 0.05006" in wide.notes[0]
    narrow = update_modes(stated("frequency_uncertainty_percent = 0.01"), "x", [tap(46.7)], source="s")
    assert narrow.machine.axes.x.modes[0].frequency_uncertainty_percent == 0.05006
    # a measured one is replaced by a better measurement
    better = update_modes(narrow.text, "x", [tap(46.7, percent=0.02)], source="s")
    assert better.machine.axes.x.modes[0].frequency_uncertainty_percent == pytest.approx(0.02, rel=1e-2)


def test_tables_that_were_not_found_go_and_say_so() -> None:
    first = update_modes(VX500, "x", [tap(46.0), tap(90.0), tap(200.0)], source="s")
    second = update_modes(first.text, "x", [tap(205.0), tap(300.0)], source="t")
    assert [mode.frequency_hz for mode in second.machine.axes.x.modes] == [205.0, 300.0]
    removed = [note for note in second.notes if note.startswith("removed")]
    assert [note.split(" Hz")[0] for note in removed] == ["removed 46.0", "removed 90.0"]
    assert "\n\n\n" not in second.text
    only = update_modes(second.text, "x", [tap(60.0)], source="t")
    assert [mode.frequency_hz for mode in only.machine.axes.x.modes] == [60.0]
    assert "participation 1" in only.notes[-2]
    assert "\n\n\n" not in only.text


def test_as_many_pairs_as_there_can_be_and_the_nearest() -> None:
    two = update_modes(VX500, "x", [tap(46.0), tap(50.0)], source="s").text.replace(
        "participation = 0.5  # share of the residues 1/m, not measured", "participation = 0.3"
    )
    moved = update_modes(two, "x", [tap(52.0), tap(48.2)], source="s").machine.axes.x.modes
    assert [(mode.frequency_hz, mode.participation) for mode in moved] == [(48.2, 1.0), (52.0, 0.3)]
    close = update_modes(two, "x", [tap(50.5)], source="s").machine.axes.x.modes
    assert [(mode.frequency_hz, mode.participation) for mode in close] == [(50.5, 0.3)]


def test_new_modes_share_the_motion_of_the_axis() -> None:
    # Two bodies on a moving base, m1 = 3 kg tapped, m2 = 1 kg light: eigenvectors normalised by the mass matrix.
    mass, stiffness = np.diag([3.0, 1.0]), np.array([[5e5, -2e5], [-2e5, 2e5]])
    squares, shapes = scipy.linalg.eigh(stiffness, mass)
    gamma = shapes.T @ mass @ np.ones(2)
    assert shapes[0] @ gamma == pytest.approx(1.0)  # what the warning says
    masses = 1.0 / shapes[0] ** 2
    taps = [tap(float(np.sqrt(w) / 6.2831853), mass=float(m)) for w, m in zip(squares, masses, strict=True)]
    fresh = update_modes(VX500, "y", taps, source="s")
    shares = [mode.participation for mode in fresh.machine.axes.y.modes]
    assert sum(shares) == pytest.approx(1.0, abs=1e-3)
    assert shares == pytest.approx((1.0 / masses) / np.sum(1.0 / masses), rel=1e-3)
    assert not [note for note in fresh.notes if note.startswith("warning")]
    assert "share of the residues 1/m, not measured" in fresh.text
    decay = update_modes(VX500, "y", [tap(f, mass=None) for f in (80.0, 100.0, 170.0)], source="s")
    assert [mode.participation for mode in decay.machine.axes.y.modes] == [0.3333] * 3
    # one that stays as stated, with 1, and a new one: more than the axis moves
    more = update_modes(VX500, "x", [tap(46.0, mass=120.0), tap(131.0, mass=60.0)], source="s")
    assert [mode.participation for mode in more.machine.axes.x.modes] == [1.0, 0.6667]
    assert "X axis sum to 1.667" in more.notes[-2]
    assert "would be 0.3333, 0.6667" in more.notes[-2]


def test_a_decay_takes_the_mass_away() -> None:
    first = update_modes(VX500, "x", [tap(46.0)], source="tap")
    second = update_modes(first.text, "x", [tap(46.1, mass=None)], source="decay stop.csv")
    (mode,) = second.machine.axes.x.modes
    assert (mode.mass_kg, mode.mass_uncertainty_percent, mode.source) == (None, None, "decay stop.csv")
    assert any("mass_kg = 20.0" in note for note in second.notes)


OVER = 'frequency_over = { axis = "z", position_mm = [0, 200], frequency_hz = [50, 42] }'
BELOW = '[axes.x.modes.frequency_over]\naxis = "z"\nposition_mm = [0, 200] # two\nfrequency_hz = [50, 42]\n'


@pytest.mark.parametrize("form", ["inline", "below"])
def test_a_table_over_a_position_stays(form: str) -> None:
    line = "# frequency_over = ...  # not known\n"
    assert line in VX500
    text = VX500.replace(line, f"{OVER}\n" if form == "inline" else f"\n{BELOW}", 1)
    update = update_modes(text, "x", [tap(47.0)], source="s")
    over = update.machine.axes.x.modes[0].frequency_over
    assert over.frequency_hz == (50, 42)
    assert ("# two" in update.text) == (form == "below")
    assert "frequency_over" in update.notes[0]
    assert update_modes(update.text, "x", [tap(47.0)], source="s").text == update.text
    with pytest.raises(MachineError, match="within frequency_over"):
        update_modes(text, "x", [tap(50.4)], source="s")


def test_line_ends_byte_order_mark_and_a_missing_last_newline() -> None:
    text = "\ufeff" + VX500[: VX500.index("\n[controller]")].rstrip().replace("\n", "\r\n")
    update = update_modes(text, "z", [tap(60.0)], source="s")
    assert update.text.startswith("\ufeff")
    assert "\n" not in update.text.replace("\r\n", "")
    assert [mode.frequency_hz for mode in update.machine.axes.z.modes] == [60.0]
    edited = update_modes(update.text, "z", [tap(60.5)], source="s")
    assert "\n" not in edited.text.replace("\r\n", "")
    bare = text[: text.index("\r\n\r\n# axes.z.modes")]
    measured = bare[: bare.rindex("  # assumed")] + "  # a mode was measured"
    assert update_modes(bare, "z", [tap(60.0)], source="s").text.startswith(measured + "\r\n")


HAND = """
name = "M"
axes.x = { max_feed_mm_per_min = 1, rapid_mm_per_min = 1, max_acceleration_mm_s2 = 1 }
axes.z = { max_feed_mm_per_min = 1, rapid_mm_per_min = 1, max_acceleration_mm_s2 = 1 }
description = '''
[[axes.y.modes]]
frequency_hz = 1
'''

[axes.y]
max_feed_mm_per_min = 1 # keep me
rapid_mm_per_min = 1
max_acceleration_mm_s2 = 1
# [[axes.x.modes]] is for X

  [[axes.y.modes]]  # first
  # by hand
  frequency_hz = 40
  damping_ratio = 0.01
  participation = 0.5

# about the end
[tolerance]
contour_um = 5
"""


def test_a_file_written_by_hand() -> None:
    update = update_modes(HAND, "y", [tap(41.0), tap(90.0)], source="s")
    kept = [line for line in HAND.splitlines() if "frequency_hz = 40" not in line and "damping_ratio" not in line]
    come = update.text.splitlines()
    assert [line for line in kept if line not in come] == []
    assert "  frequency_hz = 41.0  # 95 %: 40.9795 ... 41.0205" in come
    assert [(mode.frequency_hz, mode.participation) for mode in update.machine.axes.y.modes] == [(41, 0.5), (90, 0.5)]
    assert come.index("[[axes.y.modes]]") < come.index("# about the end")
    with pytest.raises(ArgumentError, match=r"write the axis as a table \[axes\.x\]"):
        update_modes(HAND, "x", [tap(41.0)], source="s")


def test_a_line_that_could_not_stay_as_it_is_is_refused_with_its_number() -> None:
    text = HAND.replace("[axes.y]", '[ axes . "y" ]').replace("[[axes.y.modes]]", "[[ axes . y . modes ]]")
    line = text.splitlines().index("  [[ axes . y . modes ]]  # first") + 1
    with pytest.raises(ArgumentError, match=rf"mine.toml:{line}: .*cannot be kept unchanged: write it as"):
        update_modes(text, "y", [tap(41.0)], source="s", file="mine.toml")
    with pytest.raises(MachineError, match="contour_um"):
        update_modes(VX500.replace("contour_um = 20", "contour_um = -5"), "x", [tap(46.0)], source="s")


def test_what_is_refused() -> None:
    inline = VX500[: VX500.index("[[axes.x.modes]]")] + (
        "modes = [{ frequency_hz = 46, damping_ratio = 0.02 }]\n\n"
        + VX500[VX500.index("[axes.y]") : VX500.index("[origin]")]
    )
    with pytest.raises(ArgumentError, match=r"written inline; write each as a table \[\[axes\.x\.modes\]\]"):
        update_modes(inline, "x", [tap(46.0)], source="s")
    with pytest.raises(ArgumentError, match="no supported mode"):
        update_modes(VX500, "x", [], source="s")
    with pytest.raises(ArgumentError, match="not supported: too short"):
        update_modes(VX500, "x", [tap(46.0, refusal="too short")], source="s")
    with pytest.raises(ArgumentError, match="must be x, y or z"):
        update_modes(VX500, "a", [tap(46.0)], source="s")
    with pytest.raises(MachineError, match="must be less than 100"):
        update_modes(VX500, "x", [tap(46.0, percent=120.0)], source="s")


def test_files(tmp_path: Path) -> None:
    swept = Sweep("s", "x", 0, 1.0, np.empty(0), np.empty(0), np.empty(0))
    found = Identification(files=("s",), modes=(tap(46.0),), sweep=swept)
    with pytest.raises(ArgumentError, match=r"shapegcode machine init vx500 -o mine\.toml"):
        update_machine("vx500", found)
    file = tmp_path / "mine.toml"
    file.write_text(VX500.replace("damping_ratio = 0.02", "damping_ratio = 2", 1), encoding="utf-8")
    with pytest.raises(MachineError, match="must be less than 1"):
        update_machine(file, found)
    file.write_text(VX500, encoding="utf-8")
    assert update_machine(file, found).text == (
        update_modes(VX500, "x", [tap(46.0)], source="sweep without force s").text
    )
    assert file.read_text(encoding="utf-8") == VX500


def test_a_mode_that_the_test_shows_but_does_not_support_stays() -> None:
    update = update_modes(VX500, "x", [tap(118.0)], source="tap.csv", refused=[tap(46.99, refusal="too uncertain")])
    modes = tomllib.loads(update.text)["axes"]["x"]["modes"]
    assert [mode["frequency_hz"] for mode in modes] == [46.0, 118.0]
    assert modes[0] == tomllib.loads(VX500)["axes"]["x"]["modes"][0]
    assert any(note.startswith("kept 46.0 Hz unchanged") for note in update.notes)
