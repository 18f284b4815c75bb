"""The command for tests: within this process, which is fast, or as a process of its own."""

import contextlib
import io
import os
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path
from unittest import mock

from shapegcode.cli import main

COMMAND = Path(sys.executable).with_name("shapegcode")


def _without_width() -> dict[str, str]:
    """The environment without the width of the terminal in which the tests run."""
    return {name: value for name, value in os.environ.items() if name != "COLUMNS"}


def run(folder: Path, *words: str | Path, **environment: str) -> subprocess.CompletedProcess[str]:
    """The command in a folder, within this process; an error that only --debug may show comes out as it is."""
    out, err = io.StringIO(), io.StringIO()
    with (
        contextlib.chdir(folder),
        mock.patch.dict("os.environ", {**_without_width(), **environment}, clear=True),
        contextlib.redirect_stdout(out),
        contextlib.redirect_stderr(err),
    ):
        code = main([str(word) for word in words])
    return subprocess.CompletedProcess(words, code, out.getvalue(), err.getvalue())


def run_process(
    folder: Path, *words: str | Path, limit: Callable[[], None] | None = None
) -> subprocess.CompletedProcess[str]:
    """The same as a process of its own: its start, its streams and its exit code are those of a shell."""
    return subprocess.run([COMMAND, *words], cwd=folder, capture_output=True, text=True, check=False, preexec_fn=limit)
