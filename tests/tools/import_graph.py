"""Figures of the package's import graph: `python tests/tools/import_graph.py [FOLDER OF THE PACKAGE]`.

Every import counts, also one inside a function or for types only. A floor is a set of folders (or modules at the root)
none of which imports another of it; an arrow leads upwards if its head stands on a higher floor than its tail.
"""

from __future__ import annotations

import sys
from pathlib import Path

import grimp
from scipy.sparse import csr_array
from scipy.sparse.csgraph import connected_components

Graph = dict[str, set[str]]


def imports(package: Path) -> Graph:
    """Which module imports which; the package's own root, which offers all names, is left out."""
    sys.path.insert(0, str(package.parent))
    found = grimp.build_graph(package.name, cache_dir=None)
    root = {package.name}
    return {name: found.find_modules_directly_imported_by(name) - root for name in found.modules - root}


def circles(graph: Graph) -> list[list[str]]:
    """Sets of modules that import each other, through others or not."""
    names = sorted(graph)
    links = csr_array([[other in graph[name] for other in names] for name in names])
    count, ring_of = connected_components(links, connection="strong")
    rings = [[name for name, ring in zip(names, ring_of, strict=True) if ring == one] for one in range(count)]
    return sorted(ring for ring in rings if len(ring) > 1)


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
        floor = sorted(name for name, used in left.items() if not used & left.keys()) or circles(left)[0]
        built.append(floor)
        for name in floor:
            del left[name]
    return built


def main() -> None:
    """Print the figures."""
    package = Path(sys.argv[1]) if len(sys.argv) > 1 else Path(__file__).parents[2] / "python" / "shapegcode"
    graph = imports(package.resolve())
    by_folder = {name: used for name, used in folded(graph).items() if (package / name).is_dir()}
    lines = {file: len(file.read_text(encoding="utf-8").splitlines()) for file in sorted(package.rglob("*.py"))}
    longest = max(lines, key=lambda file: lines[file])
    at_root = sorted(file.stem for file in package.glob("*.py"))
    print(f"modules: {len(lines)}, at the root: {len(at_root)} ({', '.join(at_root)})")
    built = floors(by_folder)
    print(f"floors by folder: {len(built)}")
    for number, floor in enumerate(built):
        print(f"  {number}: {', '.join(floor)}")
    print(f"circles between folders: {circles(by_folder)}")
    print(f"circles between modules: {circles(graph)}")
    print(f"lines outside the stub: {sum(lines.values())}; longest: {longest.relative_to(package)} ({lines[longest]})")


if __name__ == "__main__":
    main()
