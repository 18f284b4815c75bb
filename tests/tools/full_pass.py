"""What changed since `make test-all` last passed: `full_pass.py write | changed [core|python] | files`.

`write` puts a hash of each file that the long checks guard into tests/full_pass.txt, which is committed. `changed`
prints the groups (core, python) in which a file is new, gone or another one; nothing: all of them passed as they are.
`files` prints the changed sources and headers of the core, for clang-tidy. A change of the core counts for the Python
tests too.
"""

from __future__ import annotations

import hashlib
import subprocess
import sys
from pathlib import Path

ROOT = Path(__file__).resolve().parents[2]
STAMP = ROOT / "tests" / "full_pass.txt"
CORE = ("cpp/", "cmake/", "tests/cpp/", "CMakeLists.txt", "CMakePresets.json", ".clang-tidy")
PYTHON = (
    "bindings/",
    "python/",
    "tests/python/",
    "tests/oracles/",
    "tests/golden/",
    "tests/rejected/",
    "pyproject.toml",
)
SUFFIXES = {
    ".cpp",
    ".hpp",
    ".c",
    ".h",
    ".py",
    ".pyi",
    ".in",
    ".txt",
    ".cmake",
    ".json",
    ".toml",
    ".nc",
    ".NC",
    ".expected",
}


def present() -> dict[str, str]:
    """Name → hash of each guarded file: those that git tracks, and new ones that it does not ignore."""
    listed = subprocess.run(
        ["git", "ls-files", "--cached", "--others", "--exclude-standard", "-z"],
        cwd=ROOT,
        capture_output=True,
        check=True,
    )
    names = sorted(set(listed.stdout.decode().split("\0")))
    return {
        name: hashlib.sha256((ROOT / name).read_bytes()).hexdigest()[:16]
        for name in names
        if name.startswith(CORE + PYTHON)
        and (Path(name).suffix in SUFFIXES or name in CORE)
        and (ROOT / name).is_file()
    }


def passed() -> dict[str, str]:
    """The same as it was when everything last passed."""
    lines = STAMP.read_text(encoding="utf-8").splitlines() if STAMP.is_file() else []
    return {name: mark for mark, name in (line.split(" ", 1) for line in lines)}


def main() -> None:
    """See the module's docstring."""
    command = sys.argv[1]
    now = present()
    if command == "write":
        STAMP.write_text("".join(f"{mark} {name}\n" for name, mark in now.items()), encoding="utf-8")
        return
    then = passed()
    changed = {name for name in now.keys() | then.keys() if now.get(name) != then.get(name)}
    if command == "files":
        sources = (name for name in sorted(changed) if name.startswith("cpp/") and name.endswith((".cpp", ".hpp")))
        print(*(name for name in sources if name in now and not name.startswith("cpp/examples/")), sep="\n")
        return
    if any(name.startswith(CORE) for name in changed):
        print("core")
    if changed:
        print("python")


main()
