"""The ``shapegcode`` command.

A module of this package contains the `Interface` of one or more commands, and is imported when one of them runs. The
function of a command does the slow imports, and returns the exit code.
"""

from __future__ import annotations

import argparse
import contextlib
import errno
import importlib
import os
import signal
import sys
from collections.abc import Iterable, Sequence
from pathlib import Path
from typing import Any

from shapegcode.cli.arguments import CommandParser, Interface

_DEBUG = "--debug"
_MAX_STOP_S = 15.0  # after Ctrl-C
_FULL = (errno.ENOSPC, errno.EDQUOT, errno.EFBIG)
_WITH_REST = "batch"  # accepts options of its inner command after --


class ExitCode:
    """Exit codes of the command, the same for every sub-command."""

    OK = 0  # done, and within tolerance
    OUT_OF_TOLERANCE = 1  # done, but the result misses its tolerance
    BAD_INPUT = 2  # not done: wrong arguments, a bad program or machine file, a file that cannot be read or written
    INTERRUPTED = 130  # stopped by the user (Ctrl-C)
    BROKEN_PIPE = 141  # standard output was closed


_HOMES = {
    "programs": ("simulate", "feed", "expand", "measure", "time", "check", "compare"),
    "machine": ("machine", "setup"),
    "characterize": ("characterize", "testcut"),
    "identify": ("identify", "sweep"),
    "batch": ("batch", "study", "optimize"),
    "others": ("shaper", "report", "demo", "completion"),
}
"""Modules shared by several commands; each other command has a module of its own."""


def interface_of(command: str) -> Interface:
    """Import the module of a command, and return its options and function."""
    home = next((module for module, names in _HOMES.items() if command in names), command)
    found: Interface = getattr(importlib.import_module(f"{__name__}.{home}"), command.upper())
    return found


def command_in(words: Iterable[str]) -> str | None:
    """The first word that names a command; None: there is none."""
    return next((word for word in words if word in COMMANDS), None)


COMMANDS = {
    "convert": "convert a CNC program into an input-shaped FANUC program, and check the result",
    "shaper": "compare input shapers for some vibration modes, and recommend one",
    "simulate": "simulate a program on a model of the machine: cycle time, vibration, contour error",
    "feed": "set the feeds of a program so that cutting force and deflection stay within the tool's limits",
    "expand": "write the expanded program: calls, macros and coordinate modes resolved",
    "measure": "measure the simulated part: contour, radius, walls, roughness, vibration",
    "time": "predict the cycle time of a program and show where the time goes",
    "check": "list what the control would refuse in a program, or not run as programmed",
    "compare": "list what differs between two programs: path, rapids, tools, offsets, functions",
    "setup": "make the first machine file by answering questions",
    "machine": "write or explain a machine file, or import one from the control's parameters",
    "characterize": "measure a control with test programs, and fit the machine file to the results",
    "identify": "find vibration modes in a tap test or decay, and write them to the machine file",
    "sweep": "write a program that shakes an axis, to find modes without a hammer (identify --sweep)",
    "testcut": "write test cuts as programs, and fit cutting-force coefficients to their measured forces",
    "batch": "run a command over many programs and machines, and resume where it stopped",
    "study": "simulate a program on sampled machines (Monte Carlo): probability of staying within tolerance",
    "optimize": "choose settings for the shortest program that stays within tolerance on most sampled machines",
    "report": "make HTML pages from --json files",
    "completion": "print the shell completion script for bash, zsh or fish",
    "demo": "reproduce a paper's figures, compared with the published ones",
}
"""Help line of every sub-command, in the order of the help; its interface, in a module, has its name in capitals."""


class _Version(argparse.Action):
    """``--version``; determines the version only on request."""

    def __call__(self, parser: argparse.ArgumentParser, *_: Any) -> None:
        from shapegcode.results.json import this_version

        print(this_version())
        parser.exit(ExitCode.OK)


def parser_of(selected: str | None) -> argparse.ArgumentParser:
    """The parser with the arguments of the selected command; the others have only a name and a help line."""
    parser = CommandParser(
        prog="shapegcode",
        description="Converts CNC programs into input-shaped FANUC programs that excite less vibration.",
        epilog="exit codes: 0 done and within tolerance; 1 done but out of tolerance; 2 bad input. "
        "`shapegcode COMMAND --help` explains a command. NO_COLOR=1 turns colours off.",
    )
    parser.add_argument("--version", action=_Version, nargs=0, help="show the version and exit")
    # Only for the help: main() removes it, so that it is allowed anywhere.
    parser.add_argument(_DEBUG, action="store_true", help="show the traceback of an error")
    commands = parser.add_subparsers(dest="command", metavar="COMMAND", required=True, title="commands")
    for name, text in COMMANDS.items():
        sub = commands.add_parser(name, help=text, description=f"{text[:1].upper()}{text[1:]}.")
        if name == selected:
            interface_of(name).declare(sub)
    return parser


def _expected(error: Exception) -> bool:
    """True for errors that need no traceback: those of shapegcode, of the file system, and a missing matplotlib."""
    if isinstance(error, ModuleNotFoundError):
        return error.name == "matplotlib"
    # If the error is one of shapegcode, its core is loaded already: no import is needed.
    core = sys.modules.get("shapegcode._core")
    return isinstance(error, OSError if core is None else (OSError, core.ShapegcodeError))


def _message(error: Exception) -> str:
    """Message of an error; for a file its path and the reason, such as a missing folder."""
    kind = type(error).__name__
    if isinstance(error, ModuleNotFoundError):
        return f"pictures need {error.name}, which is not installed"
    if not isinstance(error, OSError):
        # One line per problem, each with the command's name, so that each is complete.
        return str(error).replace("\n", "\nshapegcode: ") or kind
    if error.filename is None:
        # Files are opened by name, so an error without a name is one of standard output.
        where = "standard output: " if error.errno in _FULL else ""
        return where + (error.strerror or str(error) or kind)
    path = os.fsdecode(error.filename) if isinstance(error.filename, str | bytes) else str(error.filename)
    if error.errno != errno.ENOENT:
        return f"{path}: {error.strerror or kind}"
    folder = Path(path).parent
    return f"{path}: {'no such file' if folder.is_dir() else f'the folder {folder} does not exist'}"


def _run(argv: list[str]) -> int:
    selected = next((word for word in argv if not word.startswith("-")), None)
    rest: list[str] = []
    if selected == _WITH_REST and "--" in argv:
        at = argv.index("--")
        argv, rest = argv[:at], argv[at + 1 :]
    args = parser_of(selected).parse_args(argv)
    args.rest = tuple(rest)
    args.typed = tuple([*argv, "--", *rest] if rest else argv)
    try:
        run = args.run
        if getattr(args, "program", None) == "all":
            run = importlib.import_module(f"{__name__}.several").run_all
        return int(run(args))
    finally:
        # A full disk under a redirected output is noticed only here.
        sys.stdout.flush()


class _Interrupts:
    """Records Ctrl-C, since an import may turn the interrupt into another error."""

    def __init__(self, of_process: bool) -> None:
        self.came = self.reported = False
        self._mine = of_process and signal.getsignal(signal.SIGINT) is signal.default_int_handler
        if self._mine:
            signal.signal(signal.SIGINT, self._handle)

    def _handle(self, _number: int, _frame: object) -> None:
        if not self.came and hasattr(signal, "setitimer"):
            # A lock or a long simulation may not end on the interrupt.
            signal.signal(signal.SIGALRM, self._stop_now)
            signal.setitimer(signal.ITIMER_REAL, _MAX_STOP_S)
        self.came = True
        raise KeyboardInterrupt

    def _stop_now(self, _number: int, _frame: object) -> None:
        if not self.reported:
            os.write(2, b"shapegcode: stopped\n")
        os._exit(ExitCode.INTERRUPTED)

    def end(self) -> None:
        """Ignore Ctrl-C from now on: the work is done."""
        if self._mine:
            signal.signal(signal.SIGINT, signal.SIG_IGN)


def main(argv: Sequence[str] | None = None) -> int:
    """Run the command line and return the exit code (see :class:`ExitCode`)."""
    words = list(sys.argv[1:] if argv is None else argv)
    if "numpy" not in sys.modules:
        # Matrices of a command are small: further threads of OpenBLAS would only cost processor time.
        os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")
    if "_ARGCOMPLETE" in os.environ:  # TAB completion in a shell
        importlib.import_module(f"{__name__}.others").complete()
    ctrl_c = _Interrupts(argv is None)
    try:
        return _run([word for word in words if word != _DEBUG])
    except SystemExit as stop:
        # argparse ends the process itself: 0 after --help, 2 after a wrong argument; rich with 1 after a closed pipe.
        if isinstance(stop.__context__, BrokenPipeError):
            return ExitCode.BROKEN_PIPE
        return stop.code if isinstance(stop.code, int) else ExitCode.BAD_INPUT
    except BrokenPipeError:
        # Python flushes standard output again at exit: redirect it to the null device.
        _discard_output()
        return ExitCode.BROKEN_PIPE
    except BaseException as error:  # a compiled module may turn Ctrl-C into a panic, which is not an Exception
        if ctrl_c.came or isinstance(error, KeyboardInterrupt):
            print("shapegcode: stopped", file=sys.stderr)
            ctrl_c.reported = True
            return ExitCode.INTERRUPTED
        if _DEBUG in words or not isinstance(error, Exception) or not _expected(error):
            raise
        print(f"shapegcode: {_message(error)}", file=sys.stderr)
        if isinstance(error, OSError) and error.errno == errno.ENOSPC:
            _discard_output()
        return ExitCode.BAD_INPUT
    finally:
        ctrl_c.end()


def _discard_output() -> None:
    with contextlib.suppress(OSError, ValueError):
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
