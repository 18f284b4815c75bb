"""LinuxCNC as a target: a machine from its INI file, and the lines of it that a shaped program needs."""

import math
import re
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import shapegcode as sg
from command import run
from shapegcode import _core
from shapegcode.machine.control_import import read_ini
from shapegcode.model.machine_model import fanuc_model
from test_planner_models import machine_of

INI = """\
[EMC]
MACHINE = bench mill
[DISPLAY]
MAX_FEED_OVERRIDE = 1.2   # of the feed
[EMCMOT]
SERVO_PERIOD = 500000
[TRAJ]
LINEAR_UNITS = mm
MAX_LINEAR_VELOCITY = 150
ARC_BLEND_KINK_RATIO = 0.2
ARC_BLEND_KINK_RATIO = 0.5
[AXIS_X]
MAX_VELOCITY = 200
MAX_ACCELERATION = 3000
[JOINT_0]
MAX_ACCELERATION = 2500
[AXIS_Y]
MAX_VELOCITY = 100
MAX_ACCELERATION = 2000
[AXIS_Z]
MAX_VELOCITY = 50
MAX_ACCELERATION = 1000
"""


def ini_file(folder: Path, text: str = INI) -> Path:
    file = folder / "mill.ini"
    file.write_text(text)
    return file


def test_an_ini_file_is_a_machine(tmp_path: Path) -> None:
    found = read_ini(ini_file(tmp_path))
    machine = found.machine
    assert machine.name == "bench mill" and machine.emission.dialect == "linuxcnc"
    assert [axis.max_feed_mm_per_min for axis in machine.axes.as_tuple()] == [9000.0, 6000.0, 3000.0]
    assert [axis.rapid_mm_per_min for axis in machine.axes.as_tuple()] == [9000.0, 6000.0, 3000.0]
    assert [axis.max_acceleration_mm_s2 for axis in machine.axes.as_tuple()] == [2500.0, 2000.0, 1000.0]
    controller = machine.controller
    assert controller.kind == "linuxcnc" and controller.interpolation_period_s == 0.0005
    planner = controller.linuxcnc
    # The first of a name counts; what is not there has LinuxCNC's own default.
    assert (planner.kink_ratio, planner.ramp_frequency_hz, planner.max_feed_override) == (0.2, 100.0, 1.2)
    origins = {value.key: value.remark for value in machine.values()}
    assert origins["axes.x.max_feed_mm_per_min"] == "parameters: mill.ini line 9: [TRAJ] MAX_LINEAR_VELOCITY"
    assert origins["axes.x.max_acceleration_mm_s2"] == "parameters: mill.ini line 16: [JOINT_0] MAX_ACCELERATION"


def test_inches(tmp_path: Path) -> None:
    machine = read_ini(ini_file(tmp_path, INI.replace("UNITS = mm", "UNITS = inch"))).machine
    assert machine.axes.y.max_feed_mm_per_min == pytest.approx(100.0 * 25.4 * 60.0)
    assert machine.axes.y.max_acceleration_mm_s2 == pytest.approx(2000.0 * 25.4)


@pytest.mark.parametrize(
    ("old", "new", "message"),
    [
        ("[TRAJ]", "[PATH]", "not an INI file of LinuxCNC"),
        ("MAX_VELOCITY = 100", "MAX_VELOCITY = fast", r'\[AXIS_Y\] MAX_VELOCITY = "fast": must be a number'),
        ("MAX_ACCELERATION = 1000\n", "", r"\[AXIS_Z\] MAX_ACCELERATION: is missing"),
        ("UNITS = mm", "UNITS = furlong", r'LINEAR_UNITS = "furlong": must be mm or inch'),
        ("SERVO_PERIOD = 500000", "SERVO_PERIOD = 5e9", "interpolation_period_s = 5.0: must be 0.1 or less"),
    ],
)
def test_a_bad_ini_file_is_refused(tmp_path: Path, old: str, new: str, message: str) -> None:
    with pytest.raises(sg.MachineError, match=message):
        read_ini(ini_file(tmp_path, INI.replace(old, new)))


def test_setup_reads_the_ini_file(tmp_path: Path) -> None:
    ini_file(tmp_path)
    (tmp_path / "a.toml").write_text(
        'name = "MILL"\ncontrol = "linuxcnc"\ndump = "mill.ini"\nmodes = { x = "46:0.02", z = "rigid" }\n'
    )
    done = run(tmp_path, "setup", "--answers", "a.toml", "-o", "m.toml")
    assert done.returncode == 0 and "12 values read from" in done.stdout
    machine = sg.Machine.load(tmp_path / "m.toml")
    assert machine.controller.kind == "linuxcnc" and machine.axes.x.modes[0].frequency_hz == 46.0
    (tmp_path / "b.toml").write_text('control = "linuxcnc"\nlook_ahead = "G08"\n')
    done = run(tmp_path, "setup", "--answers", "b.toml", "-o", "n.toml")
    assert done.returncode == 2 and 'is a code of FANUC controls, and control is "linuxcnc"' in done.stderr


def test_setup_without_an_ini_file(tmp_path: Path) -> None:
    (tmp_path / "a.toml").write_text('control = "linuxcnc"\nmax_acceleration_mm_s2 = 5000\n')
    assert run(tmp_path, "setup", "--answers", "a.toml", "-o", "m.toml").returncode == 0
    machine = sg.Machine.load(tmp_path / "m.toml")
    assert (machine.controller.kind, machine.emission.dialect) == ("linuxcnc", "linuxcnc")


def kinked(angle_rad: float, speed: float) -> _core.Path:
    """Two lines of 2 mm."""
    end = [2.0 + 2.0 * math.cos(angle_rad), 2.0 * math.sin(angle_rad), 0.0]
    return _core.Path([_core.Segment.line([0, 0, 0], [2, 0, 0], speed), _core.Segment.line([2, 0, 0], end, speed)])


def linuxcnc(**settings: Any) -> sg.Machine:
    return machine_of("linuxcnc", 5000.0, **settings).with_values("emission.dialect", "linuxcnc")


def test_the_kink_rule_in_closed_form() -> None:
    """v angle / T against a tenth of the acceleration: 2.5 mrad at 200 mm/s and 5 000 mm/s²."""
    model = fanuc_model(linuxcnc())
    for angle, kinks in ((2.3e-3, 0), (2.6e-3, 1)):
        found = _core.linuxcnc_slowing(kinked(angle, 200.0), model.limits, model.planner, 0.1)
        assert found.kinks == kinks and found.segments == 2
        # Beside that what the acceleration itself adds in a period.
        assert found.largest_ratio == pytest.approx((200.0 / 1e-3 + 5000.0) * angle / 5000.0, rel=1e-3)
        assert (found.speed_mm_per_s, found.angle_rad) == (200.0, pytest.approx(angle, rel=1e-6))


ROUND = "G21G90\nG00X0.Y0.Z0.\nG01X20.F12000.\nG03X40.Y20.R20.\nG01Y40.\nG00Z10.\nM30\n"


def test_shaped_arcs_meet_at_less_than_half_of_what_the_kink_rule_allows() -> None:
    conversion = sg.convert(ROUND, linuxcnc(), shape_all=True)
    text = conversion.text.decode()
    assert re.search(r"^G0[23]X-?[\d.]*\.\d{5}", text, re.MULTILINE)  # five decimals
    for place in conversion.placed:
        path = place.blocks(conversion.emitted)
        for before, behind in zip(list(path), list(path)[1:], strict=False):
            step = 1e-4 * min(before.length_mm, behind.length_mm)
            ends = [
                np.array(before.end_mm) - np.array(before.point_at(before.length_mm - step)),
                np.array(behind.point_at(step)) - np.array(behind.start_mm),
            ]
            first, second = (each / np.linalg.norm(each) for each in ends)
            speed = min(before.feed_mm_per_s, behind.feed_mm_per_s)
            assert np.linalg.norm(second - first) < 0.5 * 0.1 * 5000.0 * 1e-3 / speed + 1e-4
    assert not any("KINK_RATIO" in each for each in conversion.warnings)
    assert any("ARC_BLEND_RAMP_FREQ = 10000" in each for each in conversion.warnings)
    both = linuxcnc(ramp_frequency_hz=10_000.0)
    assert not any("INI file" in each for each in sg.convert(ROUND, both, shape_all=True).warnings)


def test_check_says_which_lines_and_why(tmp_path: Path) -> None:
    machine = linuxcnc().with_values({"emission.dialect": "fanuc"})
    zigzag = "".join(f"X{0.7 * k:.3f}Y{3.0 * math.sin(0.07 * k):.3f}\n" for k in range(1, 120))
    text = f"G21G90\nG00X0.Y0.Z0.\nG01F6000.\n{zigzag}G00Z10.\nM30\n"
    shaped = sg.convert(text, machine, shape_all=True).text
    (tmp_path / "shaped.nc").write_bytes(shaped)
    found = {each.code: each for each in sg.check(tmp_path / "shaped.nc", machine).findings}
    assert (
        "of the acceleration, and 0.1 is allowed; INI file: [TRAJ] ARC_BLEND_KINK_RATIO = "
        in found["kink_ratio"].message
    )
    assert found["kink_ratio"].severity == "warning" and found["kink_ratio"].line > 0
    assert "[TRAJ] ARC_BLEND_RAMP_FREQ = 10000 (now 100)" in found["ramp_frequency"].message
    (tmp_path / "plain.nc").write_text(text)
    assert not {"kink_ratio", "ramp_frequency"} & {
        each.code for each in sg.check(tmp_path / "plain.nc", machine).findings
    }
