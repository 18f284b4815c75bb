"""Figures of the package's import graph: `python tests/tools/import_graph.py [FOLDER OF THE PACKAGE]`.

Every import counts, also one inside a function or for types only. A floor is a set of folders (or modules at the root)
none of which imports another of it; an arrow leads upwards if its head stands on a higher floor than its tail.
"""

from __future__ import annotations

import ast
import sys
from pathlib import Path

Graph = dict[str, set[str]]


def modules(package: Path) -> dict[str, Path]:
    """Files of the package by their full names."""
    found = {}
    for file in sorted(package.rglob("*.py")):
        parts = file.relative_to(package.parent).with_suffix("").parts
        found[".".join(parts[:-1] if parts[-1] == "__init__" else parts)] = file
    return found


def imports(files: dict[str, Path]) -> Graph:
    """Which module imports which; the package's own root, which offers all names, is left out."""
    root = next(iter(files)).split(".")[0]
    graph: Graph = {}
    for name, file in files.items():
        named = set()
        for node in ast.walk(ast.parse(file.read_text(encoding="utf-8"), filename=str(file))):
            if isinstance(node, ast.Import):
                named |= {alias.name for alias in node.names}
            elif isinstance(node, ast.ImportFrom) and node.level == 0 and node.module:
                # A name is a module of that package, or something inside of it.
                named |= {
                    full if (full := f"{node.module}.{alias.name}") in files else node.module for alias in node.names
                }
        own = {name for name in named if name in files}
        graph[name] = own - {name, root}
    graph.pop(root, None)
    return graph


def circles(graph: Graph) -> list[list[str]]:
    """Sets of modules that import each other, through others or not."""
    reach: Graph = {}

    def reached(name: str) -> set[str]:
        seen, waiting = set(), list(graph.get(name, ()))
        while waiting:
            one = waiting.pop()
            if one not in seen:
                seen.add(one)
                waiting += graph.get(one, ())
        return seen

    for name in graph:
        reach[name] = reached(name)
    inside = {name for name in graph if name in reach[name]}
    found: list[list[str]] = []
    while inside:
        one = min(inside)
        ring = {other for other in inside if other in reach[one] and one in reach[other]} | {one}
        found.append(sorted(ring))
        inside -= ring
    return found


def folded(graph: Graph) -> Graph:
    """The same between folders of the root; a module at the root stands for itself."""
    result: Graph = {}
    for name, used in graph.items():
        here = name.split(".")[1]
        result.setdefault(here, set()).update(one.split(".")[1] for one in used)
    return {here: used - {here} for here, used in result.items()}


def floors(graph: Graph) -> list[list[str]]:
    """From the bottom up; what is in a circle stands on one floor."""
    left, built = dict(graph), []
    while left:
        floor = sorted(name for name, used in left.items() if not used & left.keys())
        if not floor:
            floor = sorted(circles(left)[0])
        built.append(floor)
        for name in floor:
            del left[name]
    return built


def main() -> None:
    """Print the figures."""
    package = Path(sys.argv[1]) if len(sys.argv) > 1 else Path(__file__).parents[2] / "python" / "shapegcode"
    files = modules(package)
    graph = imports(files)
    by_folder = {name: used for name, used in folded(graph).items() if (package / name).is_dir()}
    lines = {name: len(file.read_text(encoding="utf-8").splitlines()) for name, file in files.items()}
    longest = max(lines, key=lambda name: lines[name])
    at_root = sorted(file.stem for file in package.glob("*.py"))
    print(f"modules: {len(files)}, at the root: {len(at_root)} ({', '.join(at_root)})")
    built = floors(by_folder)
    print(f"floors by folder: {len(built)}")
    for number, floor in enumerate(built):
        print(f"  {number}: {', '.join(floor)}")
    print(f"circles between folders: {circles(by_folder)}")
    print(f"circles between modules: {circles(graph)}")
    print(f"lines outside the stub: {sum(lines.values())}; longest: {longest} ({lines[longest]})")


if __name__ == "__main__":
    main()
