"""What shapegcode_rt is made of, as Markdown: ``docs/reference/shapegcode_rt.md``; ``make docs`` writes it.

`tests/python/test_rt_page.py` holds what is said here: the tests are there, every call of the interface stands in the
table, and the library asks for no other symbol than these.
"""

from __future__ import annotations

import re
from dataclasses import dataclass
from pathlib import Path

ROOT = Path(__file__).resolve().parents[2]
MAX_LINES = 9000


@dataclass(frozen=True)
class HeldBy:
    """A test: its file below tests/ and a text that stands in it, of a Python test its function."""

    file: str
    name: str
    proves: str


TESTS = {
    "allocation": HeldBy(
        "cpp/allocation_controller.cpp",
        "MotionController::push, ",
        "push, step, override, hold, resume, abort, restart, state allocate, free, lock nothing",
    ),
    "program": HeldBy(
        "cpp/allocation_program.cpp",
        "MotionController: plan, events, dwells, stops, probe, flush",
        "nor do these and the set-point with derivatives",
    ),
    "in C": HeldBy("cpp/allocation_c.cpp", "shapegcode_controller_push and _step", "nor does the C interface"),
    "beside push": HeldBy(
        "cpp/allocation_controller.cpp", "MotionController::step beside push", "nor do push and step in two threads"
    ),
    "kernel": HeldBy(
        "cpp/allocation_controller.cpp",
        "MotionController without system calls",
        "no system call at all: the kernel would end the process",
    ),
    "threads": HeldBy(
        "cpp/thread_tests.cpp",
        "session_of",
        "no data race between threads that push, plan, step and read the state, under ThreadSanitizer (`make threads`)",
    ),
    "limits": HeldBy(
        "cpp/test_motion_controller.cpp",
        "limits are kept at every set-point, whatever the operator does",
        "speed, acceleration and jerk of every axis, difference by difference",
    ),
    "random": HeldBy(
        "cpp/test_random_control.cpp",
        "any control keeps its limits, whatever its settings and however long its path",
        "the same for random settings and paths",
    ),
    "late": HeldBy(
        "cpp/test_online_planner.cpp",
        "where plan() comes too late the motion stops within the limits, counts it, and goes on",
        "a planning thread that does not come in time",
    ),
    "tolerance": HeldBy(
        "cpp/test_online_planner.cpp",
        "the path is left by no more than the tolerance",
        "rounding within the contour tolerance",
    ),
    "bits": HeldBy(
        "cpp/test_online_planner.cpp", "the same pushes at the same periods give the same bits", "repeatable"
    ),
    "override": HeldBy(
        "cpp/test_online_planner.cpp",
        "a new override acts behind the section that is being run",
        "when an override acts",
    ),
    "hold": HeldBy(
        "cpp/test_online_planner.cpp",
        "a hold brakes behind the section that is being run, and the motion goes on from there",
        "when a hold decelerates, and that the path is resumed",
    ),
    "refused": HeldBy(
        "cpp/test_motion_controller.cpp", "what cannot be run is refused, and says why", "every result of a push"
    ),
    "starved": HeldBy(
        "cpp/test_motion_controller.cpp",
        "segments that run out stop the motion and are counted; it goes on with the next",
        "buffer underrun: segments that come too late",
    ),
    "settings": HeldBy(
        "python/test_motion_controller.py",
        "test_settings_that_cannot_be_are_refused",
        "invalid settings are refused with value and limit",
    ),
    "derivatives": HeldBy(
        "python/test_motion_controller.py",
        "test_velocity_and_acceleration_are_those_of_the_set_points",
        "velocity and acceleration",
    ),
    "events": HeldBy(
        "python/test_motion_controller.py",
        "test_events_come_where_the_set_points_are",
        "events come when the set-points reach their position",
    ),
    "dwells": HeldBy("python/test_motion_controller.py", "test_a_dwell_is_rest_for_so_long", "the length of a dwell"),
    "stops": HeldBy(
        "python/test_motion_controller.py", "test_a_programmed_stop_waits_for_the_operator", "a programmed stop"
    ),
    "abort": HeldBy(
        "python/test_motion_controller.py", "test_abort_forgets_the_path_and_restart_begins_anew", "abort, restart"
    ),
    "state": HeldBy("python/test_motion_controller.py", "test_the_state_says_what_it_is", "the snapshot"),
    "delay": HeldBy(
        "python/test_motion_controller.py", "test_the_delay_is_what_the_set_points_lag", "delay of the set-points"
    ),
    "sessions": HeldBy(
        "cpp/operator_session.cpp",
        "OperatorSession::run",
        "random sessions of an operator: limits, path, events, rest",
    ),
    "probe": HeldBy(
        "python/test_probe_and_flush.py", "test_a_probe_stops_the_motion_on_its_path", "probe, and where it rests"
    ),
    "flush": HeldBy(
        "python/test_probe_and_flush.py", "test_a_flush_at_rest_in_a_dwell_and_twice", "flush in every state"
    ),
    "manual": HeldBy(
        "cpp/allocation_program.cpp",
        "MotionController: axes by hand, offset, spindle, emergency stop",
        "nor do these",
    ),
    "jog": HeldBy(
        "python/test_manual_motion.py",
        "test_an_axis_is_jogged_from_hold_and_comes_back_onto_the_path",
        "limits while jogging, and that no part of the path is skipped",
    ),
    "increments": HeldBy(
        "python/test_manual_motion.py", "test_an_increment_takes_the_shortest_time", "an increment, by its closed form"
    ),
    "retrace": HeldBy(
        "python/test_manual_motion.py", "test_the_path_is_retraced_and_run_on", "back along the path and forward again"
    ),
    "travel": HeldBy(
        "python/test_manual_motion.py",
        "test_soft_limits_refuse_at_the_push_and_hold_when_they_move",
        "travel limits",
    ),
    "offset": HeldBy(
        "python/test_manual_motion.py",
        "test_an_offset_is_added_within_its_own_limits",
        "the offset's limits, and those of the sum; backlash",
    ),
    "emergency": HeldBy(
        "python/test_manual_motion.py",
        "test_an_emergency_stop_takes_the_hardware_limit",
        "distance of an emergency stop, by its closed form",
    ),
    "rapids": HeldBy(
        "python/test_spindle_feed.py", "test_rapids_have_an_override_of_their_own", "rapids and their override"
    ),
    "exchange": HeldBy(
        "python/test_shaper_exchange.py",
        "test_limits_hold_whenever_they_are_exchanged",
        "limits while a shaper is exchanged",
    ),
    "thread": HeldBy(
        "python/test_spindle_feed.py",
        "test_a_thread_keeps_its_pitch",
        "threads: pitch error within the computed bound",
    ),
    "C": HeldBy("cpp/c_interface.c", "refused_calls", "the C interface: calls that are refused, with their status"),
    "closed loop": HeldBy(
        "python/test_example_control.py",
        "test_drives_are_the_linear_model",
        "a whole control: program, operator, drives",
    ),
}


@dataclass(frozen=True)
class Call:
    """Calls of MotionController with the same promises."""

    names: tuple[str, ...]
    thread: str
    work: str
    tests: tuple[str, ...]


CALLS = (
    Call(("MotionController",), "before all others", "allocates all memory; may throw", ("settings",)),
    Call(
        ("push",),
        "pushing",
        "one junction",
        ("allocation", "beside push", "kernel", "threads", "refused", "starved"),
    ),
    Call(
        ("push_event", "push_dwell", "push_stop"),
        "pushing",
        "an entry of a ring buffer",
        ("program", "threads", "events", "dwells", "stops"),
    ),
    Call(
        ("step",),
        "stepping (real-time)",
        "a point, and every filter once; with `plans_in_step` also the planning",
        ("allocation", "beside push", "kernel", "threads", "limits", "random", "late", "bits", "derivatives"),
    ),
    Call(("next_event",), "stepping (real-time)", "an entry of a ring buffer", ("program", "threads", "events")),
    Call(("probe",), "stepping (real-time)", "a copy, and a flush", ("program", "probe")),
    Call(
        ("plan",),
        "planning",
        "plans the window: bounded by its segments and by the longest stop",
        ("program", "threads", "late", "tolerance", "limits"),
    ),
    Call(("feed_override",), "any", "a word", ("allocation", "threads", "override", "random")),
    Call(("rapid_override",), "any", "a word", ("manual", "threads", "rapids")),
    Call(
        ("exchange_shaper",),
        "any",
        "a word; every step runs all shapers of the settings",
        ("manual", "threads", "exchange", "sessions"),
    ),
    Call(("spindle",), "stepping (real-time)", "two filters of third order", ("manual", "thread")),
    Call(
        ("jog", "jog_by"),
        "any; for each axis always the same",
        "a word or two; in `step` at most some hundred iterations when an axis starts to stop",
        ("manual", "threads", "jog", "increments", "sessions"),
    ),
    Call(
        ("retrace",),
        "any",
        "a word; in `step` a bisection in the recorded periods",
        ("manual", "threads", "retrace", "sessions"),
    ),
    Call(("offset",), "any", "a word", ("manual", "threads", "offset", "sessions")),
    Call(("travel",), "any", "two words", ("manual", "threads", "travel")),
    Call(("emergency_stop",), "any", "two words", ("manual", "emergency", "sessions")),
    Call(("hold", "resume"), "any", "a word", ("allocation", "threads", "hold", "sessions")),
    Call(
        ("flush", "flushed"),
        "any; `flushed` the pushing thread",
        "a word; `flushed` resets the filters",
        ("program", "threads", "flush", "sessions"),
    ),
    Call(("abort",), "any", "a word", ("allocation", "abort")),
    Call(("restart",), "any, while no thread pushes, plans or steps", "resets the filters", ("allocation", "abort")),
    Call(
        ("state",),
        "any",
        "a copy; repeated only if three steps were done meanwhile",
        ("allocation", "threads", "state"),
    ),
    Call(("axes", "delay_periods", "correction_delay"), "any", "a number", ("delay",)),
)

_STRING = "std::__cxx11::basic_string<char, std::char_traits<char>, std::allocator<char> >"
SYMBOLS = {
    "memory, in constructors and destructors": [
        "operator new(unsigned long)",
        "operator new(unsigned long, std::align_val_t)",
        "operator delete(void*, std::align_val_t)",
        "operator delete(void*, unsigned long, std::align_val_t)",
        "operator delete(void*, unsigned long)",
        "malloc",
        "calloc",
        "free",
    ],
    "memory that is allocated already": ["memchr", "memcpy", "memmove", "memset", "strcmp", "strlen"],
    "mathematics": [
        "acos",
        "asin",
        "atan2",
        "cbrt",
        "cos",
        "cosh",
        "exp",
        "expm1",
        "fma",
        "hypot",
        "log",
        "lround",
        "pow",
        "remainder",
        "round",
        "sincos",
        "sinh",
        "__divdc3",
    ],
    "numbers in messages": [
        "std::to_chars(char*, char*, double, std::chars_format)",
        "std::to_chars(char*, char*, double, std::chars_format, int)",
    ],
    "errors of constructors, and passing them to C": [
        "_Unwind_Resume",
        "__cxa_allocate_exception",
        "__cxa_begin_catch",
        "__cxa_end_catch",
        "__cxa_free_exception",
        "__cxa_rethrow",
        "__cxa_throw",
        "__gxx_personality_v0",
        "std::__throw_bad_alloc()",
        "std::__throw_bad_array_new_length()",
        "std::__throw_length_error(char const*)",
        "std::__throw_logic_error(char const*)",
        "std::__throw_out_of_range_fmt(char const*, ...)",
        "std::runtime_error::what() const",
        "std::runtime_error::~runtime_error()",
        "std::bad_alloc::~bad_alloc()",
        "std::exception::~exception()",
        f"std::runtime_error::runtime_error({_STRING} const&)",
        "typeinfo for std::runtime_error",
        "typeinfo for std::bad_alloc",
        "typeinfo for std::exception",
        "vtable for std::bad_alloc",
        "vtable for __cxxabiv1::__class_type_info",
        "vtable for __cxxabiv1::__si_class_type_info",
    ],
    "the loader, static objects, reference counts": [
        "_ITM_deregisterTMCloneTable",
        "_ITM_registerTMCloneTable",
        "__cxa_finalize",
        "__gmon_start__",
        "__cxa_guard_acquire",
        "__cxa_guard_release",
        "__libc_single_threaded",
    ],
}
"""What the library asks of others, by what for."""

COVERAGE_DATE = "2026-11-28"
COVERAGE = {
    "base": (100.0, 96.1),
    "path": (94.0, 72.5),
    "limits": (100.0, 90.8),
    "filter": (92.6, 91.4),
    "planner": (98.6, 93.6),
    "controller": (96.2, 84.2),
    "c": (88.2, 76.4),
}
"""By folder: lines and branches in percent that the C++ tests run."""

WHAT = {
    "base": "errors, messages, modes, samples",
    "path": "lines, arcs, paths of them",
    "filter": "FIR filters, batch and real-time",
    "limits": "what segments and corners allow",
    "planner": "rounded junctions, nearly time-optimal motion, stops",
    "controller": "`MotionController`: queue, planner over a window, sections, filters",
    "c": "the C interface",
    "public headers": "`shapegcode/*.hpp`, `shapegcode.h`",
}


def cmake_list(name: str) -> list[str]:
    """A list of CMakeLists.txt."""
    text = (ROOT / "CMakeLists.txt").read_text(encoding="utf-8")
    found = re.search(rf"^set\({name}\s+([^)]*)\)", text, re.MULTILINE)
    if found is None:
        raise ValueError(f"CMakeLists.txt has no list {name}")
    return found[1].split()


def rt_files() -> dict[str, list[Path]]:
    """All that shapegcode_rt is compiled of, by folder, as CMakeLists.txt has it."""
    source, public = ROOT / "cpp" / "src", ROOT / "cpp" / "include" / "shapegcode"
    files = {folder: sorted((source / folder).rglob("*.[ch]pp")) for folder in cmake_list("rt_folders")}
    return files | {"public headers": [public / name for name in cmake_list("rt_headers")]}


def code_lines(file: Path) -> int:
    """Lines that hold more than a comment."""
    text = re.sub(r"/\*.*?\*/", "", file.read_text(encoding="utf-8"), flags=re.DOTALL)
    return sum(bool(line.strip()) and not line.strip().startswith("//") for line in text.splitlines())


def public_calls() -> set[str]:
    """Functions of MotionController, by its header."""
    text = (ROOT / "cpp/include/shapegcode/controller.hpp").read_text(encoding="utf-8")
    body = text[text.index("class MotionController {") : text.index(" private:\n  class Implementation")]
    body = re.sub(r"//.*", "", body)
    return {name for name in re.findall(r"(\w+)\([^()]*\)[^;]*;", body) if name != "operator"}


def rt_documentation() -> str:
    """The whole page: rt_page.md with its tables."""
    text = (Path(__file__).parent / "rt_page.md").read_text(encoding="utf-8")
    tables = {
        "contents": _contents(),
        "limit": str(MAX_LINES),
        "calls": "\n".join(
            f"| `{'`, `'.join(call.names)}` | {call.thread} | {call.work} | {', '.join(call.tests)} |" for call in CALLS
        ),
        "tests": "\n".join(f"| {key} | {test.proves} | {_link(test)} |" for key, test in TESTS.items()),
        "symbols": "\n".join(f"| {what} | {', '.join(map(_short, names))} |" for what, names in SYMBOLS.items()),
        "coverage_date": COVERAGE_DATE,
        "coverage": "\n".join(
            f"| {folder} | {lines:.1f} | {branches:.1f} |" for folder, (lines, branches) in COVERAGE.items()
        ),
    }
    for name, table in tables.items():
        text = text.replace(f"{{{name}}}", table)
    return text


def _contents() -> str:
    counts = {folder: len(files) for folder, files in rt_files().items()}
    rows = [f"| {folder} | {WHAT[folder]} | {count} |" for folder, count in counts.items()]
    return "\n".join([*rows, f"| all of it | | {sum(counts.values())} |"])


def _link(test: HeldBy) -> str:
    return f"[`{Path(test.file).name}`](../../tests/{test.file}): `{test.name.strip().rstrip(',')}`"


def _short(name: str) -> str:
    return f"`{name.replace(_STRING, 'std::string')}`"
