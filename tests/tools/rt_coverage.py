"""How much of shapegcode_rt ran, by folder: `rt_coverage.py BUILD`, a build with counters. Needs gcov alone.

Lines of templates and headers count once, as run if they ran anywhere. Branches are those that are no throw.
"""

from __future__ import annotations

import json
import re
import subprocess
import sys
from collections import defaultdict
from pathlib import Path

ROOT = Path(__file__).resolve().parents[2]

Counts = dict[str, dict[tuple[int, int], bool]]


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


def counted(build: Path) -> tuple[Counts, Counts]:
    """Lines and branches by file: whether each ran."""
    lines: Counts = defaultdict(dict)
    branches: Counts = defaultdict(dict)
    for notes in sorted((build / "CMakeFiles" / "shapegcode_rt.dir").rglob("*.gcda")):
        done = subprocess.run(
            ["gcov", "--json-format", "--stdout", "--branch-probabilities", notes.resolve()],
            capture_output=True,
            check=True,
            cwd=build,
        )
        for file in json.loads(done.stdout)["files"]:
            name = str((build / file["file"]).resolve())
            for line in file["lines"]:
                key = (line["line_number"], 0)
                lines[name][key] = lines[name].get(key, False) or line["count"] > 0
                for k, branch in enumerate(branch for branch in line["branches"] if not branch["throw"]):
                    key = (line["line_number"], k)
                    branches[name][key] = branches[name].get(key, False) or branch["count"] > 0
    return lines, branches


def main() -> None:
    """A row for each folder, and one for all."""
    build = Path(sys.argv[1]).resolve()
    lines, branches = counted(build)
    everything: list[list[bool]] = [[], []]
    for folder, files in rt_files().items():
        ran = [[flag for file in files for flag in counts.get(str(file), {}).values()] for counts in (lines, branches)]
        everything = [[*before, *part] for before, part in zip(everything, ran, strict=True)]
        print(f"  {folder:15} {_share(ran[0])} of lines, {_share(ran[1])} of branches")
    print(f"  {'all of it':15} {_share(everything[0])} of lines, {_share(everything[1])} of branches")


def _share(flags: list[bool]) -> str:
    return f"{100.0 * sum(flags) / len(flags):5.1f} % of {len(flags)}" if flags else "none"


if __name__ == "__main__":
    main()
