"""What a person sees of every command: help in groups, examples that parse, how much is said, tables that fit."""

import argparse
import os
import shlex
import subprocess
import sys
from collections import defaultdict
from collections.abc import Iterator
from pathlib import Path

import pytest

from command import run
from shapegcode.cli import COMMANDS, ExitCode, parser_of
from shapegcode.cli.arguments import GROUPS, examples
from shapegcode.results.table import Column, Table

PART = "%\nO0001\nG90 G17 G21 G94\nG00 X0 Y0 Z5.\nG01 Z-1. F300\nX20. F900\nX20. Y20.\nG00 Z5.\nM30\n%\n"


def _actions(parser: argparse.ArgumentParser) -> dict[str, argparse.ArgumentParser]:
    return next((a.choices for a in parser._actions if isinstance(a, argparse._SubParsersAction)), {})


def parsers() -> Iterator[tuple[str, argparse.ArgumentParser]]:
    """Every command and action with its parser."""
    for command in COMMANDS:
        parser = _actions(parser_of(command))[command]
        yield command, parser
        for name, action in _actions(parser).items():
            yield f"{command} {name}", action


def test_each_command_has_two_examples_that_it_understands() -> None:
    found = dict(parsers())
    assert set(examples()) == set(found)
    for name, parser in found.items():
        lines = examples()[name]
        assert len(lines) == 2, name
        text = parser.format_help()
        for example in map(str.strip, lines):
            assert f"\n  {example}\n" in text, name
            words = shlex.split(example.partition(" > ")[0])
            assert words[0] == "shapegcode"
            assert words[1 : 1 + len(name.split())] == name.split() or name in ("machine", "testcut")
            parser_of(words[1]).parse_args(words[1:])
        assert "exit code" in " ".join(text.lower().split()), name


def test_options_stand_in_groups() -> None:
    for name, parser in parsers():
        loose = [
            action.option_strings or action.dest
            for group in parser._action_groups
            for action in group._group_actions
            if group.title not in GROUPS
            and action.dest != "help"
            and not isinstance(action, argparse._SubParsersAction)
        ]
        assert not loose, f"{name}: add them to cli.arguments.GROUPS"
        sizes = [len(group._group_actions) for group in parser._action_groups]
        assert max(sizes) <= 15, name


def test_a_name_means_the_same_everywhere() -> None:
    by_option, by_dest, units = defaultdict(set), defaultdict(set), defaultdict(set)
    for _, parser in parsers():
        for action in parser._actions:
            for option in action.option_strings:
                if option.startswith("--"):
                    by_option[option].add(action.dest)
            if action.option_strings:
                by_dest[action.dest].add(next(o for o in action.option_strings if o.startswith("--")))
                if action.nargs != 0 and not action.choices:
                    units[action.option_strings[-1]].add((action.metavar, action.type))
    assert not {option: dests for option, dests in by_option.items() if len(dests) > 1}
    assert not {dest: options for dest, options in by_dest.items() if len(options) > 1}
    # What is written has the name of what it is, and the program of a test cut its number.
    assert {option for option, each in units.items() if len(each) > 1} <= {"--html", "--output", "--program"}


def test_quiet_says_the_answer_and_verbose_everything(tmp_path: Path) -> None:
    (tmp_path / "part.nc").write_text(PART)
    words = ("time", "part.nc", "-m", "vx500")
    usual, quiet, verbose = (run(tmp_path, *words, *more).stdout for more in ((), ("--quiet",), ("--verbose",)))
    assert quiet.splitlines()[0] == usual.splitlines()[0] == verbose.splitlines()[0]
    assert all(line.startswith(("warning:", " ")) for line in quiet.splitlines()[1:])
    assert quiet.count("\n") < usual.count("\n")
    figures = {word for word in usual.split() if word[0].isalnum()}
    assert figures <= set(verbose.split())
    both = run(tmp_path, *words, "-q", "-v")
    assert both.returncode == 2
    assert "not allowed with" in both.stderr
    bad = run(tmp_path, "time", "absent.nc", "-m", "vx500", "-q")
    assert (bad.returncode, bad.stderr.count("absent.nc: no such file")) == (2, 1)


@pytest.mark.parametrize("width", [20, 34, 80])
def test_a_table_leaves_columns_out_by_their_priority(width: int) -> None:
    columns = (
        Column("name", value=lambda row: row[0], left=True),
        Column("first", value=lambda row: row[1], priority=2),
        Column("second", value=lambda row: row[2]),
        Column("needed", value=lambda row: row[3], priority=0),
    )
    table = Table("title", columns, [("abcdefgh", "11111", "2222222", "33")])
    from rich.console import Console

    console = Console(width=width, color_system=None)
    with console.capture() as capture:
        console.print(table)
    text = capture.get()
    assert ("11111" in text, "2222222" in text) == (width >= 34, width >= 34)
    assert "abcdefgh" in text
    assert "33" in text
    assert all(len(line.rstrip()) <= width or line.startswith("left out") for line in text.splitlines())
    assert ("left out" in text) == (width < 34)
    assert "left out" not in str(table.everything())


def test_the_bar_moves_within_one_region(tmp_path: Path) -> None:
    """A program of one cut is not half done for most of the time: at least ten rising shares, the last is the whole."""
    import shapegcode as sg
    from shapegcode.cli import convert as command

    (tmp_path / "part.nc").write_text(PART)
    machine = sg.Machine.load("vx500")
    program = sg.Program.read(tmp_path / "part.nc", machine)
    assert len(program.regions) == 1
    shares: list[float] = []

    class Bar:
        def update(self, share: float) -> None:
            shares.append(share)

    args = parser_of("convert").parse_args(["convert", "part.nc", "-m", "vx500", "-o", "out.nc"])
    command._converted(args, program, machine, Bar())  # type: ignore[arg-type]
    assert len(set(shares)) >= 10
    assert shares == sorted(shares)
    assert shares[-1] == pytest.approx(1.0)


def test_older_names_of_options_still_work() -> None:
    for words, dest in (
        ("convert part.nc -m vx500 -o out.nc --all", "shape_all"),
        ("shaper -m vx500 --all", "verbose"),
        ("measure part.nc -m vx500 --tool-diameter 10mm --all", "verbose"),
    ):
        parser = parser_of(words.split()[0])
        assert getattr(parser.parse_args(words.split()), dest) is True
        assert "--all" not in _actions(parser)[words.split()[0]].format_help()


@pytest.mark.parametrize("no_colour", ["", "1"])
def test_escape_codes_are_for_terminals_that_want_colours(no_colour: str, monkeypatch: pytest.MonkeyPatch) -> None:
    import io

    from shapegcode.cli.runner import output_console

    class Terminal(io.StringIO):
        def isatty(self) -> bool:
            return True

    monkeypatch.setenv("NO_COLOR", no_colour)
    monkeypatch.setenv("TERM", "xterm")
    stream = Terminal()
    output_console(file=stream).print("answer", style="bold red")
    assert ("\x1b" in stream.getvalue()) == (not no_colour)


@pytest.mark.parametrize("words", ["shaper --mode 46", "time {part} -m vx500", "time {part} -m vx500 --json -"])
def test_a_closed_pipe_ends_the_command_with_its_exit_code(words: str, tmp_path: Path) -> None:
    part = tmp_path / "part.nc"
    part.write_text(PART)
    reader, writer = os.pipe()
    os.close(reader)
    try:
        command = [sys.executable, "-m", "shapegcode", *shlex.split(words.format(part=part))]
        done = subprocess.run(command, stdout=writer, stderr=subprocess.PIPE, text=True, check=False)
    finally:
        os.close(writer)
    assert (done.returncode, done.stderr) == (ExitCode.BROKEN_PIPE, "")
