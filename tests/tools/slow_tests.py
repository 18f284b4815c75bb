"""Writes which tests take long, from the log of a run of all quick ones:

    .venv/bin/python -m pytest -n 2 --dist worksteal -m 'not slow' --durations=0 > durations.log
    python3 tests/tools/slow_tests.py durations.log [SECONDS]

Adds those that took so long or longer (1 s) to tests/python/slow_tests.txt. tests/python/conftest.py gives what stands
there the mark `slow`.
"""

from __future__ import annotations

import re
import sys
from pathlib import Path

LIST = Path(__file__).resolve().parents[1] / "python" / "slow_tests.txt"
HEAD = "# Marked `slow`, because they took a second or more: written by tests/tools/slow_tests.py.\n"


def read_list() -> set[str]:
    """Names of the tests, `test_file.py::test_name[case]`."""
    lines = LIST.read_text().splitlines() if LIST.is_file() else []
    return {line for line in lines if line and not line.startswith("#")}


def main() -> None:
    """Add what a log says."""
    min_s = float(sys.argv[2]) if len(sys.argv) > 2 else 1.0
    found = read_list()
    for line in Path(sys.argv[1]).read_text().splitlines():
        if (one := re.fullmatch(r"(\d+\.\d+)s call +tests/python/(\S.*?) *", line)) and float(one[1]) >= min_s:
            found.add(one[2])
    LIST.write_text(HEAD + "".join(f"{name}\n" for name in sorted(found)))


if __name__ == "__main__":
    main()
