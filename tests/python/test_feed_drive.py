"""The feed drive against SciPy: Radau on a second implementation of the equations, lsim; and its machine file."""

import copy
import math
from typing import Any

import numpy as np
import pytest
from scipy.signal import lsim

import feed_drive_reference as reference
from acceptance import machine_with
from shapegcode import ArgumentError, NumericError, _core
from shapegcode.errors import MachineError
from shapegcode.io.units import FloatArray
from shapegcode.machine import Machine
from shapegcode.model.modes import drive_parameters

PERIOD_S = 1e-3
LUGRE = _core.FrictionParameters(
    _core.FrictionModel.lugre,
    viscous_n_s_per_m=1500,
    coulomb_n=300,
    static_n=450,
    stribeck_velocity_m_per_s=0.005,
    bristle_stiffness_n_per_m=3e7,
    bristle_damping_n_s_per_m=3e4,
)
STRIBECK = _core.FrictionParameters(
    _core.FrictionModel.stribeck,
    viscous_n_s_per_m=1500,
    coulomb_n=300,
    static_n=450,
    stribeck_velocity_m_per_s=0.005,
    smoothing_velocity_m_per_s=2e-4,
)


def drive(**changes: Any) -> _core.FeedDriveParameters:
    """A drive of a machining centre with LuGre friction and one mode on the table."""
    values: dict[str, Any] = {
        "motor_mass_kg": 150,
        "table_mass_kg": 400,
        "stiffness_n_per_m": 1.2e8,
        "damping_n_s_per_m": 1e4,
        "position_gain_per_s": 30,
        "velocity_gain_n_s_per_m": 1.65e5,
        "velocity_integral_time_s": 0.02,
        "table_friction": LUGRE,
        "motor_friction": _core.FrictionParameters(viscous_n_s_per_m=500),
        "modes": [_core.Mode(46, 0.02)],
    }
    return _core.FeedDriveParameters(**(values | changes))


def reversals_mm(count: int) -> FloatArray:
    """Forth, a rest in which the table sticks, back, and on through zero."""
    t = np.arange(1, count + 1) * PERIOD_S
    return np.asarray(np.interp(t, [0, 0.04, 0.08, 0.12, 0.2], [0, 1.5, 1.5, 0.5, -1.5]), dtype=np.float64)


def quadrant_mm(count: int) -> FloatArray:
    """One axis of a circle of 20 mm at 50 mm/s, at rest at first, through its reversal half way."""
    t = np.arange(count) * PERIOD_S
    angle = 50.0 / 20.0 * (t - t[count // 2])
    start = np.minimum(t / 0.03, 1.0) ** 2 * (3 - 2 * np.minimum(t / 0.03, 1.0))
    return np.asarray(20.0 * (np.cos(angle) - math.cos(angle[0])) * start)


@pytest.mark.parametrize(
    ("changes", "setpoints", "allowed_um"),
    [
        ({}, reversals_mm(200), 0.05),
        ({}, quadrant_mm(200), 0.1),
        ({"table_friction": STRIBECK}, reversals_mm(200), 0.5),
        pytest.param(
            {"velocity_feed_forward_ratio": 0.9, "acceleration_feed_forward_ratio": 0.7},
            quadrant_mm(120),
            0.1,
            marks=pytest.mark.slow,
        ),
        pytest.param({"backlash_m": 1e-5}, reversals_mm(120), 0.1, marks=pytest.mark.slow),
        ({"position_feedback": _core.PositionFeedback.table, "backlash_m": 4e-6}, reversals_mm(120), 0.1),
        ({"force_limit_n": 800.0, "velocity_feed_forward_ratio": 0.9}, reversals_mm(120), 0.5),
    ],
    ids=["reversals", "quadrant", "stribeck", "feed-forward", "backlash", "scale", "limit"],
)
def test_friction_plant_is_radaus(changes: dict[str, Any], setpoints: FloatArray, allowed_um: float) -> None:
    parameters = drive(**changes)
    wanted = reference.play(reference.Drive(parameters, PERIOD_S), setpoints)
    usual = _core.FeedDrive(parameters, PERIOD_S).respond(setpoints)[:, :4]
    assert np.abs(usual - wanted)[:, :3].max() < allowed_um * 1e-3
    tight = _core.FeedDrive(parameters, PERIOD_S, 1e-9, 1e-10).respond(setpoints)[:, :4]
    assert np.abs(tight - wanted)[:, :3].max() < 2e-7  # mm
    assert np.abs(tight - wanted)[:, 3].max() < 2e-3  # N, of 300


def test_quadrant_glitch_is_there_and_a_frictionless_drive_has_none() -> None:
    setpoints = quadrant_mm(400)
    turn = slice(150, 300)

    def glitch_um(**changes: Any) -> float:
        table = _core.FeedDrive(drive(modes=[], **changes), PERIOD_S).respond(setpoints)[turn, 1]
        smooth = np.polynomial.Polynomial.fit(np.arange(len(table)), table, 6)(np.arange(len(table)))
        return float(np.abs(table - smooth).max() * 1e3)

    assert glitch_um() > 1.0
    assert glitch_um(table_friction=_core.FrictionParameters(viscous_n_s_per_m=1500)) < 0.05


def test_table_sticks_at_rest_on_its_bristles() -> None:
    setpoints = reversals_mm(80)[:80]
    simulated = _core.FeedDrive(drive(modes=[]), PERIOD_S).respond(
        np.concatenate([setpoints, np.full(600, setpoints[-1])])
    )
    rest = simulated[-200:]
    assert np.ptp(rest[:, 1]) < 2e-4  # mm: the bristles creep
    assert 100 < abs(rest[-1, 3]) < 450
    np.testing.assert_allclose(rest[-1, 5], rest[-1, 3], rtol=1e-3)  # the spring holds what the friction takes


@pytest.mark.parametrize(("viscous", "velocity", "acceleration"), [(1500, 0.0, 0.0), (1500, 0.8, 0.0), (0, 1.0, 0.9)])
def test_linear_drive_is_lsim(viscous: float, velocity: float, acceleration: float) -> None:
    """Feed-forward of the acceleration is the second input of the linear model."""
    parameters = drive(
        table_friction=_core.FrictionParameters(viscous_n_s_per_m=viscous),
        velocity_feed_forward_ratio=velocity, acceleration_feed_forward_ratio=acceleration,
    )  # fmt: skip
    setpoints = quadrant_mm(300)
    a, b, c, d = _core.linear_model(parameters)
    inputs = np.column_stack([setpoints, np.diff(setpoints, prepend=0.0) / PERIOD_S])[:, : 2 if acceleration else 1]
    _, wanted, _ = lsim((a, b, c, d), inputs, np.arange(len(setpoints)) * PERIOD_S)
    found = _core.FeedDrive(parameters, PERIOD_S, 1e-11, 1e-12).respond(setpoints[1:])[:, 0]
    assert np.abs(found - wanted[1:]).max() < 1e-8 * np.abs(wanted).max()


def test_linear_model_refuses_what_is_not_linear() -> None:
    for changes in ({}, {"table_friction": _core.FrictionParameters(), "backlash_m": 1e-6}):
        with pytest.raises(ArgumentError, match="linear model needs"):
            _core.linear_model(drive(**changes))


def test_real_time_form_is_cvodes() -> None:
    setpoints = quadrant_mm(400)
    found = _core.FeedDriveRealTime(drive(), PERIOD_S).respond(setpoints)
    wanted = _core.FeedDrive(drive(), PERIOD_S, 1e-9, 1e-10).respond(setpoints)[:, 0]
    assert np.abs(found - wanted).max() < 3e-5


def test_a_copy_is_a_drive_of_its_own() -> None:
    setpoints = quadrant_mm(100)
    first = _core.FeedDrive(drive(), PERIOD_S)
    first.respond(setpoints[:50])
    second = copy.copy(first)
    response = first.response_mm
    second.respond(setpoints[50:])
    assert first.response_mm == response
    assert np.abs(first.respond(setpoints[50:])[-1, 0] - second.response_mm) < 1e-4


def test_bad_arguments() -> None:
    with pytest.raises(ArgumentError, match="motor is -1 kg"):
        drive(motor_mass_kg=-1)
    with pytest.raises(ArgumentError, match="static friction of the pair is 1 N"):
        _core.FrictionParameters(
            _core.FrictionModel.stribeck, coulomb_n=2, static_n=1, stribeck_velocity_m_per_s=1,
            smoothing_velocity_m_per_s=1,
        )  # fmt: skip
    plant = _core.FeedDrive(drive(), PERIOD_S)
    with pytest.raises(ArgumentError, match=r"shape \(n,\)"):
        plant.respond(np.zeros((3, 3)))
    with pytest.raises(ArgumentError, match="set-point is nan"):
        plant.respond(np.array([0.0, math.nan]))
    with pytest.raises(NumericError, match=r"CVode failed with CV_\w+ at t ="):
        plant.step(1e300)


def test_machine_file_to_drives() -> None:
    machine = Machine.load("vx500")
    drives = drive_parameters(machine)
    table = machine.axes.x.drive
    x = drives[0]
    # One turn is a lead: the kinetic energy is the same either way.
    speed, lead_m = 0.2, table.screw_lead_mm * 1e-3
    turning = 0.5 * table.motor_inertia_kg_m2 * (2 * math.pi * speed / lead_m) ** 2
    assert 0.5 * x.motor_mass_kg * speed**2 == pytest.approx(turning)
    assert x.force_limit_n * lead_m == pytest.approx(2 * math.pi * table.torque_limit_n_m)  # work of one turn
    assert x.stiffness_n_per_m == pytest.approx(150e6)
    assert x.table_friction.bristle_stiffness_n_per_m == pytest.approx(30e6)
    assert (x.position_gain_per_s, x.velocity_feed_forward_ratio) == (30.0, 0.0)
    assert [(mode.frequency_hz, mode.damping_ratio) for mode in x.modes] == [(46.0, 0.02)]
    assert [len(d.modes) for d in drives] == [1, 1, 0]
    # Motor against table with the screw between: free vibration of two masses, damped as the file says.
    free = _core.FeedDriveParameters(
        motor_mass_kg=x.motor_mass_kg, table_mass_kg=x.table_mass_kg, stiffness_n_per_m=x.stiffness_n_per_m,
        damping_n_s_per_m=x.damping_n_s_per_m, position_gain_per_s=1e-6, velocity_gain_n_s_per_m=1e-6,
    )  # fmt: skip
    poles = np.linalg.eigvals(_core.linear_model(free)[0])
    resonance = poles[np.argmax(np.abs(poles))]
    assert -resonance.real / abs(resonance) == pytest.approx(table.damping_ratio, rel=1e-6)
    for parameters in drives:
        plant = _core.FeedDrive(parameters, PERIOD_S)
        assert plant.respond(np.minimum(0.05 * np.arange(800), 20.0))[-1, 1] == pytest.approx(20.0, abs=0.02)


def test_a_machine_without_drives_says_which_table_it_lacks() -> None:
    with pytest.raises(MachineError) as caught:
        drive_parameters(Machine.load("kimm004"))
    assert [problem.key for problem in caught.value.problems] == ["axes.x.drive", "axes.y.drive", "axes.z.drive"]
    assert "required for a simulation with feed drives" in str(caught.value)


def test_friction_model_asks_for_its_figures() -> None:
    with pytest.raises(MachineError, match=r"axes\.y\.drive.*needs friction_static_n"):
        machine_with({"axes.y.drive.friction_static_n": None})
    with pytest.raises(
        MachineError, match=r"friction_static_n is 100\.0: must not be below friction_coulomb_n, 300\.0"
    ):
        machine_with({"axes.x.drive.friction_static_n": 100.0})
    with pytest.raises(MachineError, match=r"stiffness_n_per_um = -1\.0: must be greater than 0 \(unit: N/µm\)"):
        machine_with({"axes.z.drive.stiffness_n_per_um": -1.0})
    assert machine_with({"axes.x.drive.friction_model": "viscous", "axes.x.drive.friction_static_n": None})


def test_a_loop_that_grows_by_itself_is_refused() -> None:
    """Against the poles of the equations of motion, written out: motor and table, position and speed, and integral."""
    slow = {f"axes.{axis}.drive.velocity_bandwidth_hz": 5.0 for axis in "xyz"}
    machine, gain = machine_with(slow), 100.0
    p = drive_parameters(machine)[0]
    m, t, k, c = p.motor_mass_kg, p.table_mass_kg, p.stiffness_n_per_m, p.damping_n_s_per_m
    speed_gain, integral_s = p.velocity_gain_n_s_per_m, p.velocity_integral_time_s
    motor, table = p.motor_friction.viscous_n_s_per_m, p.table_friction.viscous_n_s_per_m
    poles = np.linalg.eigvals(
        [
            [0.0, 1.0, 0.0, 0.0, 0.0],
            [-(speed_gain * gain + k) / m, -(speed_gain + motor + c) / m, k / m, c / m, speed_gain / integral_s / m],
            [0.0, 0.0, 0.0, 1.0, 0.0],
            [k / t, c / t, -k / t, -(c + table) / t, 0.0],
            [-gain, -1.0, 0.0, 0.0, 0.0],
        ]
    )
    worst = poles[np.argmax(poles.real)]
    found = f"grows by a factor e in {1.0 / worst.real:.3g} s at {abs(worst.imag) / (2.0 * math.pi):.4g} Hz"
    with pytest.raises(MachineError, match=f"axes.x.drive: the loop is unstable: it {found}"):
        drive_parameters(machine.with_values({f"controller.position_gain_per_s.{axis}": gain for axis in "xyz"}))
