"""What changed since `make test-all` last passed: `full_pass.py write [tidy] | changed | files`.

`write` puts a hash of each group of files that the long checks guard into tests/full_pass.txt, which is committed: a
folder of cpp/, or all of another place. `changed` prints what must run again (core, python) because a file of it is
new, gone or another one; nothing: all of it passed as it is. `files` prints the sources and headers of the core's
folders that clang-tidy must read again, which reads a folder as one and finds in the others what it found before: those
that changed since it last passed, which `write tidy` notes in the same file, or include a header of one that did. A
change of the core counts for the Python tests too.
"""

from __future__ import annotations

import hashlib
import re
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
TIDIED = ("cpp/src", "cpp/include", ".clang-tidy")
TIDY = "tidy "  # before the names of these groups: what clang-tidy has read
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


def guarded() -> dict[str, list[str]]:
    """Names of the guarded files by group: those that git tracks, and new ones that it does not ignore."""
    listed = subprocess.run(
        ["git", "ls-files", "--cached", "--others", "--exclude-standard", "-z"],
        cwd=ROOT,
        capture_output=True,
        check=True,
    )
    groups: dict[str, list[str]] = {}
    for name in sorted(set(listed.stdout.decode().split("\0"))):
        if (
            name.startswith(CORE + PYTHON)
            and (Path(name).suffix in SUFFIXES or name in CORE)
            and (ROOT / name).is_file()
        ):
            groups.setdefault(group_of(name), []).append(name)
    return groups


def group_of(name: str) -> str:
    """The folder of a file of cpp/; else the place of `CORE` and `PYTHON` that it is in."""
    if name.startswith("cpp/"):
        return f"{Path(name).parent.as_posix()}/"
    return next(place for place in CORE + PYTHON if name.startswith(place))


def mark_of(names: list[str]) -> str:
    """Hash of a group: of the names and contents of its files."""
    lines = (f"{hashlib.sha256((ROOT / name).read_bytes()).hexdigest()[:16]} {name}\n" for name in names)
    return hashlib.sha256("".join(lines).encode()).hexdigest()[:16]


def core_folders(groups: dict[str, list[str]], changed: set[str]) -> list[str]:
    """Folders of the core to be checked again: those that changed and, through any number of headers, their users."""
    folders = sorted(group for group in groups if group.startswith(("cpp/src", "cpp/include")))
    if ".clang-tidy" in changed:
        return folders
    included = {name: included_files(name) for folder in folders for name in groups[folder]}
    found = {name for folder in changed.intersection(folders) for name in groups[folder]}
    while more := {name for name, headers in included.items() if headers & found} - found:
        found |= more
    return sorted({group_of(name) for name in found})


def included_files(name: str) -> set[str]:
    """What a file includes of the project's own: of the two include folders or from beside it."""
    text = (ROOT / name).read_text(encoding="utf-8")
    starts = ("cpp/include", "cpp/src", str(Path(name).parent))
    headers = re.findall(r'^#include "(.+)"', text, re.MULTILINE)
    return {f"{start}/{header}" for header in headers for start in starts if (ROOT / start / header).is_file()}


def main() -> None:
    """See the module's docstring."""
    command, *only = sys.argv[1:]
    groups = guarded()
    now = {group: mark_of(names) for group, names in groups.items()}
    now |= {f"{TIDY}{group}": mark for group, mark in now.items() if group.startswith(TIDIED)}
    lines = STAMP.read_text(encoding="utf-8").splitlines() if STAMP.is_file() else []
    then = {group: mark for mark, group in (line.split(" ", 1) for line in lines)}
    if command == "write":
        kept = {group: mark for group, mark in then.items() if only and not group.startswith(TIDY)}
        kept |= {group: mark for group, mark in now.items() if not only or group.startswith(TIDY)}
        STAMP.write_text("".join(f"{mark} {group}\n" for group, mark in sorted(kept.items())), encoding="utf-8")
        return
    changed = {group for group in now.keys() | then.keys() if now.get(group) != then.get(group)}
    if command == "files":
        tidied = {group.removeprefix(TIDY) for group in changed if group.startswith(TIDY)}
        folders = core_folders(groups, tidied)
        print(*(name for group in folders for name in groups[group] if name.endswith((".cpp", ".hpp"))), sep="\n")
        return
    changed = {group for group in changed if not group.startswith(TIDY)}
    if any(group.startswith(CORE) for group in changed):
        print("core")
    if changed:
        print("python")


if __name__ == "__main__":
    main()
