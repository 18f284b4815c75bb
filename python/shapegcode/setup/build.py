"""Make a short machine file from answers, with their provenance; everything else is a default."""

from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path
from typing import Any

from shapegcode.errors import ArgumentError, FileError, MachineError, ShapegcodeError
from shapegcode.identification.identify import identify
from shapegcode.identification.update import update_modes
from shapegcode.machine import Machine
from shapegcode.machine.control_import import import_parameters, read_ini
from shapegcode.machine.result import ParameterImport
from shapegcode.setup.answers import EXPLAINED, Answers, is_mode, mode_of
from shapegcode.setup.result import MachineSetup, OpenQuestion

_ANSWERED = "answered"
_IN_WORDS = {"name": "name", "control": "description"}
_LOOK_AHEAD = {"G05.1": (["G05.1 Q0"], ["G05.1 Q1"]), "G08": (["G08 P0"], ["G08 P1"])}
_LIMITS = ("max_feed_mm_per_min", "rapid_mm_per_min", "max_acceleration_mm_s2")


def set_up(answers: Answers) -> MachineSetup:
    """Make the machine file of a shop from its answers.

    Args:
        answers: the answers of the shop.

    Returns:
        The machine, its short file, and the open questions.

    Raises:
        MachineError: a value that is invalid in a machine file, or a dump that cannot be read.
        ArgumentError, RecordError: a tap test without a supported mode, or a dump from which nothing was read.
        OSError: a file cannot be read.
    """
    machine, notes = _started(answers)
    remarks = dict(machine.remarks)
    values = dict(_answered_values(answers))
    machine = machine.with_values({key: value for key, (value, _) in values.items()}, source=answers.name)
    remarks |= {key: remark for key, (_, remark) in values.items()}
    machine = machine.with_remarks(_for_axes(machine, remarks))
    text = machine.to_toml(short=True)
    known = {axis: answer for axis, answer in answers.modes.model_dump().items() if answer not in ("rigid", "unknown")}
    for axis, answer in known.items():
        if is_mode(answer):
            continue
        found = identify(answer)
        if not found.modes:
            raise ArgumentError(f"modes.{axis} = {answer!r}: no mode that the data support: {found.answer}")
        others = "".join(other for other in known if other != axis)  # their modes are this machine's
        text = update_modes(
            text, axis, found.modes, source=found.source, refused=found.refused, file=answers.name, keep_modes=others
        ).text
        frequencies = ", ".join(f"{mode.frequency_hz.value:g} Hz" for mode in found.modes)
        notes.append(f"{axis.upper()}: {frequencies} from {answer}")
    machine = Machine.from_toml(text, answers.name)
    # Name and kind of control are stored in keys without an origin.
    named = {key for name, key in _IN_WORDS.items() if getattr(answers, name) != Answers.model_fields[name].default}
    return MachineSetup(
        machine=answers.name,
        answered=tuple(sorted(named | {v.key for v in machine.values() if v.remark.startswith(_ANSWERED)})),
        imported=tuple(sorted(value.key for value in machine.values() if value.origin in ("dump", "measured"))),
        open=tuple(_open(machine)),
        notes=tuple(notes),
        warnings=(EXPLAINED["dnc_baud"](None),) if answers.delivery == "dnc" and answers.dnc_baud is None else (),
        text=text,
    )


def _started(answers: Answers) -> tuple[Machine, list[str]]:
    """The machine of the dump, or one with the limits of the answers; and remarks on what was read."""
    rigid = "".join(axis for axis, answer in answers.modes.model_dump().items() if answer == "rigid")
    if answers.dump is not None and answers.control == "linuxcnc":
        ini = read_ini(answers.dump, name=answers.name)
        return ini.machine, [f"{ini.count} values read from {answers.dump}", *ini.notes]
    if answers.dump is not None:
        found = _imported(answers, rigid)
        if not found.ok:
            raise ArgumentError(f"dump = {answers.dump!r}: nothing was read from it: {found.answer}")
        return found.machine, [f"{len(found.read)} parameters read from {answers.dump}"]
    return _plain(answers), []


def _imported(answers: Answers, rigid: str) -> ParameterImport:
    """The machine of the parameter file; missing limits are from the answers, or assumed and marked so."""
    dump = answers.dump
    assert dump is not None
    try:
        return import_parameters(dump, name=answers.name, rigid=rigid)
    except MachineError as error:
        if any(problem.value or problem.key.rpartition(".")[2] not in _LIMITS for problem in error.problems):
            raise
    found = import_parameters(dump, _plain(answers), name=answers.name, rigid=rigid)
    read = {each.key for each in found.read}
    own = {
        f"axes.{axis}.max_feed_mm_per_min": getattr(found.machine.axes, axis).rapid_mm_per_min
        for axis in "xyz"
        if answers.max_feed_mm_per_min is None and f"axes.{axis}.max_feed_mm_per_min" not in read
    }
    machine = found.machine.with_values(own, source=answers.name) if own else found.machine
    return replace(found, machine=machine.with_remarks(dict(found.machine.remarks)))


def dump_problem(file: str, control: str | None = None) -> str:
    """Problem of a parameter file, checked before the other questions; empty: none."""
    try:
        _started(Answers.model_validate({"dump": file, "control": control}))
    except (FileError, ArgumentError, OSError) as error:
        return str(error)
    return ""


def dump_lacks_rapids(file: str) -> bool:
    """True if the rapid rates must be asked for although there is a parameter file."""
    try:
        import_parameters(file)
    except MachineError as error:
        return any(problem.key.endswith(".rapid_mm_per_min") and not problem.value for problem in error.problems)
    return False


def tap_problem(file: str) -> str:
    """Problem of the record of a tap test, checked before the other questions; empty: none."""
    try:
        found = identify(file)
    except (ShapegcodeError, OSError) as error:
        return str(error)
    return "" if found.modes else f"{file}: no mode that the data support: {found.answer}"


def _plain(answers: Answers) -> Machine:
    """A machine with the limits of the answers; the others are assumed and marked so."""
    rapid, feed, acceleration = answers.rapid_mm_per_min, answers.max_feed_mm_per_min, answers.max_acceleration_mm_s2
    axes: dict[str, Any] = {}
    remarks = {}
    for axis in "xyz":
        own = 24_000.0 if rapid is None else getattr(rapid, axis)
        limits = {
            "max_feed_mm_per_min": (feed, own, "the rapid rate"),
            "rapid_mm_per_min": (rapid, own, "24 m/min, usual for a machining centre"),
            "max_acceleration_mm_s2": (acceleration, 3000.0, "0.3 g, usual for a machining centre"),
        }
        axes[axis] = {}
        for name, (answer, assumed, why) in limits.items():
            axes[axis][name] = assumed if answer is None else getattr(answer, axis)
            remarks[f"axes.{axis}.{name}"] = f"assumed: {why}" if answer is None else _ANSWERED
    control = {
        "fanuc": "FANUC control", "linuxcnc": "LinuxCNC", "other": "control that reads FANUC's G-code",
        None: "control not known yet",
    }  # fmt: skip
    data = {"name": answers.name, "description": f"{control[answers.control]}; set up by answers", "axes": axes}
    if answers.control == "linuxcnc":
        data |= {"controller": {"kind": "linuxcnc", "block_end": "carry"}, "emission": {"dialect": "linuxcnc"}}
    return Machine.from_data(data, answers.name).with_remarks(remarks)


def _answered_values(answers: Answers) -> Iterator[tuple[str, tuple[object, str]]]:
    """Yield key, value and remark of the answers; limits only with a parameter file, else `_plain` sets them."""
    yield "name", (answers.name, "")
    if answers.dump is not None:
        yield "description", (f"read from {Path(answers.dump).name}; set up by answers", "")
        for name in _LIMITS:
            if (answer := getattr(answers, name)) is not None:
                for axis in "xyz":
                    yield f"axes.{axis}.{name}", (getattr(answer, axis), _ANSWERED)
    if answers.least_increment_mm is not None:
        yield "controller.least_increment_mm", (answers.least_increment_mm, _ANSWERED)
    if answers.dnc_baud is not None:
        yield "controller.dnc_baud", (answers.dnc_baud, f"{_ANSWERED}: the line that feeds programs")
    elif answers.delivery not in (None, "dnc"):
        yield "controller.dnc_baud", (0, f"{_ANSWERED}: programs come from {answers.delivery}")
    if answers.program_memory_kb is not None:
        yield "controller.program_memory_bytes", (round(answers.program_memory_kb * 1024), _ANSWERED)
    if answers.look_ahead in _LOOK_AHEAD:
        off, on = _LOOK_AHEAD[answers.look_ahead]
        yield "emission.prologue", (off, f"{_ANSWERED}: look-ahead off before a shaped cut")
        yield "emission.epilogue", (on, f"{_ANSWERED}: and on again")
    if answers.contour_um is not None:
        yield "tolerance.contour_um", (answers.contour_um, f"choice, {_ANSWERED}")
    for axis, answer in answers.modes.model_dump().items():
        if answer == "rigid":
            yield f"axes.{axis}.rigid", (True, f"{_ANSWERED}: no significant mode")
        elif is_mode(answer):
            frequency, damping = mode_of(answer)
            mode = {"frequency_hz": frequency, "damping_ratio": damping}
            yield f"axes.{axis}.modes", ([mode], "")
            if ":" in answer:
                yield f"axes.{axis}.modes.1.damping_ratio", (mode["damping_ratio"], _ANSWERED)


def _for_axes(machine: Machine, remarks: dict[str, str]) -> dict[str, str]:
    """The remarks of keys that the machine has; adds remarks of modes, and of axes without modes."""
    held = {value.key for value in machine.values()}
    found = {key: remark for key, remark in remarks.items() if key in held and remark}
    for axis, table in zip("xyz", machine.axes.as_tuple(), strict=True):
        stem = f"axes.{axis}"
        for number in range(1, len(table.modes) + 1):
            found.setdefault(f"{stem}.modes.{number}.frequency_hz", _ANSWERED)
            found.setdefault(f"{stem}.modes.{number}.damping_ratio", "assumed: not answered")
        if not table.modes and not table.rigid:
            found[f"{stem}.modes"] = "not known: tap it, or declare it rigid"
    return found


def _open(machine: Machine) -> Iterator[OpenQuestion]:
    """Yield parameters without an answer that may affect a verdict: axes without modes first."""
    for letter, axis in zip("xyz", machine.axes.as_tuple(), strict=True):
        if not axis.modes and not axis.rigid:
            command = f"shapegcode identify TAP.csv --axis {letter} --update MACHINE"
            yield OpenQuestion(f"axes.{letter}.modes", "none", "simulated as rigid until it is tapped", command)
    for value in machine.values():
        if value.origin == "assumed" and not value.key.endswith(".modes"):
            unit = "" if value.unit == "1" else value.unit
            yield OpenQuestion(value.key, f"{value.value} {unit}".strip(), value.remark.removeprefix("assumed: "), "")
