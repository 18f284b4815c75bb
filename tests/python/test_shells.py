"""Completion in real shells, and manual pages as a real formatter reads them."""

import os
import pty
import re
import shutil
import signal
import subprocess
import sys
from pathlib import Path

import pytest
import write_man

from shapegcode.cli import COMMANDS

BIN = Path(sys.executable).parent
ENVIRONMENT = {**os.environ, "PATH": f"{BIN}{os.pathsep}{os.environ['PATH']}", "TERM": "dumb"}


def shell(name: str, script: str, folder: Path) -> str:
    assert shutil.which(name), f"{name} is missing: `make test-packages` installs it"
    done = subprocess.run(
        [name, "-c", script], capture_output=True, text=True, check=False, cwd=folder, env=ENVIRONMENT
    )
    return done.stdout


BASH = """
eval "$(shapegcode completion bash)"
ask() {{ COMP_LINE="$1"; COMP_POINT=${{#COMP_LINE}}; COMP_WORDS=($1); [[ $1 == *' ' ]] && COMP_WORDS+=("")
COMP_CWORD=$((${{#COMP_WORDS[@]}} - 1)); COMP_TYPE=9; COMPREPLY=(); _python_argcomplete shapegcode
echo "${{COMPREPLY[@]}}"; }}
{asks}
"""


def test_bash(tmp_path: Path) -> None:
    asks = ["shapegcode conv", "shapegcode convert --sha", "shapegcode simulate --plant ", "shapegcode machine di"]
    said = shell("bash", BASH.format(asks="\n".join(f'ask "{line}"' for line in asks)), tmp_path).splitlines()
    assert [set(line.split()) for line in said] == [
        {"convert"}, {"--shape-all", "--shape-rapids", "--shaper"}, {"modal", "feed-drive"}, {"diff"},
    ]  # fmt: skip


def test_fish(tmp_path: Path) -> None:
    script = "shapegcode completion fish | source\n" + "\n".join(
        f'complete -C "{line}"'
        for line in ("shapegcode conv", "shapegcode convert --sha", "shapegcode simulate --plant ")
    )
    said = {line.split("\t")[0].strip() for line in shell("fish", script, tmp_path).splitlines()}
    assert {"convert", "--shape-rapids", "--shaper", "modal", "feed-drive"} <= said
    assert "simulate" not in said


def test_zsh(tmp_path: Path) -> None:
    """TAB at its prompt: zsh has no other way to ask."""
    assert shutil.which("zsh"), "zsh is missing: `make test-packages` installs it"
    lines = ["autoload -Uz compinit && compinit -u -D", 'eval "$(shapegcode completion zsh)"', "echo rea''dy"]
    child, terminal = pty.fork()
    if child == 0:
        os.chdir(tmp_path)
        os.execvpe("zsh", ["zsh", "-f", "-i"], ENVIRONMENT)
    try:
        os.write(terminal, ("\n".join(lines) + "\n").encode())
        assert "ready" in read_until(terminal, "ready")
        os.write(terminal, b"shapegcode simulate --pla\t")
        # It rings the bell where it knows nothing.
        assert "nt" in read_until(terminal, r"--pla\W*nt|\x07")
        os.write(terminal, b" mod\t")
        assert "al" in read_until(terminal, r"mod\W*al|\x07")
    finally:
        os.kill(child, signal.SIGKILL)
        os.waitpid(child, 0)
        os.close(terminal)


def read_until(terminal: int, pattern: str) -> str:
    text = ""
    while not re.search(pattern, text):
        text += os.read(terminal, 4096).decode(errors="replace")
    return text


def test_an_unknown_shell_is_refused(capsys: pytest.CaptureFixture[str]) -> None:
    from shapegcode.cli import main

    assert main(["completion", "cmd"]) == 2
    assert "bash" in capsys.readouterr().err


def test_manual_pages_are_what_a_formatter_takes(tmp_path: Path) -> None:
    """A page for each command; mandoc finds nothing wrong, and shows groups, options and examples."""
    pages = write_man.pages()
    assert set(pages) == {"shapegcode.1", *(f"shapegcode-{command}.1" for command in COMMANDS)}
    for name, text in pages.items():
        (tmp_path / name).write_text(text, encoding="utf-8")
    files = sorted(tmp_path.glob("*.1"))
    checked = subprocess.run(
        ["mandoc", "-T", "lint", "-W", "warning", *files], capture_output=True, text=True, check=False
    )
    # Its date is in the form of the package that writes the pages.
    assert [line for line in checked.stdout.splitlines() if "cannot parse date" not in line] == []
    shown = subprocess.run(
        ["mandoc", "-T", "utf8", tmp_path / "shapegcode-convert.1"], capture_output=True, text=True, check=False
    ).stdout
    plain = re.sub(r".\x08", "", shown)
    for said in (
        "OUTPUT",
        "--contour-tolerance LENGTH",
        "shapegcode convert part.nc -m vx500 -o shaped.nc",
        "exit codes",
    ):
        assert said in plain
