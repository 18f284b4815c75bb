"""The rules of the house: who may include whom in C++, what is loaded when, what every public name must say."""

from __future__ import annotations

import ast
import importlib.metadata
import inspect
import re
import shutil
import subprocess
import sys
from collections.abc import Callable, Iterable, Iterator
from pathlib import Path

import pytest
import shapegcode_version
import write_docs

from shapegcode.program.stamp import REGION_MARK

ROOT = Path(__file__).resolve().parents[2]
CPP = ROOT / "cpp"
PACKAGE = ROOT / "python" / "shapegcode"

# The folders of cpp/src from the bottom up: each may include what stands before it. `program` knows nothing of motion,
# shaping and plants, so that text is read without a machine.
ORDER = (
    "base path limits filter planner controller motion program shaper plant measure compare identify milling command "
    "write simulate c"
)
FOLDERS = ORDER.split()
NOT_FROM = {
    "program": {"filter", "limits", "motion", "controller", "planner"},
    "measure": {"filter", "limits", "motion", "controller", "planner", "program", "shaper", "plant"},
}
# Public headers whose folder of sources has another name; one that is named like a folder, or lies in it, is its own.
HEADERS = {
    "base": "error.hpp mode.hpp samples.hpp",
    "c": "shapegcode.h",
    "motion": "fanuc_model.hpp planner_models.hpp",
    "path": "columns.hpp",
    "program": "expanded_program.hpp linuxcnc_program.hpp siemens_program.hpp",
    "shaper": "minimal_shapers.hpp",
    "simulate": "simulation.hpp simulation_stream.hpp timing.hpp",
    "write": "linear_feed.hpp",
}
HEADER_FOLDERS = {header: folder for folder, headers in HEADERS.items() for header in headers.split()}
# They are for users and include what lies below; nobody in the library includes them.
UMBRELLAS = {"shapegcode.hpp", "prototype.hpp"}
INCLUDE = re.compile(r'^[ \t]*#[ \t]*include[ \t]*([<"])([^>"]+)[>"]', re.MULTILINE)


def cpp_files(*folders: str) -> list[Path]:
    return sorted(
        file for folder in folders for file in (CPP / folder).rglob("*") if file.suffix in {".hpp", ".cpp", ".h"}
    )


def includes(file: Path) -> list[tuple[str, str]]:
    """(bracket, name) of every include line."""
    return INCLUDE.findall(file.read_text(encoding="utf-8"))


def offenders(files: Iterable[Path], offends: Callable[[Path, str, str], bool]) -> list[str]:
    """What is wrong of the includes of files, by file, bracket and name."""
    return [
        f"{file.relative_to(ROOT)} includes {name}"
        for file in files
        for bracket, name in includes(file)
        if offends(file, bracket, name)
    ]


def own_folder(file: Path) -> str:
    """`program` for cpp/src/program/text/lexer.cpp and for the public header of that folder."""
    if file.is_relative_to(CPP / "src"):
        return file.relative_to(CPP / "src").parts[0]
    return included_folder("shapegcode/" + file.relative_to(CPP / "include" / "shapegcode").as_posix())


def included_folder(name: str) -> str:
    """The folder that an own include belongs to."""
    if not name.startswith("shapegcode/"):
        return Path(name).parts[0]
    header = name.removeprefix("shapegcode/")
    return HEADER_FOLDERS.get(header, Path(header).parts[0].removesuffix(".hpp"))


def test_there_are_sources_to_check() -> None:
    assert len(cpp_files("include", "src")) > 20
    assert (PACKAGE / "cli").is_dir()


def test_cpp_knows_nothing_of_python() -> None:
    def is_pythons(_file: Path, _bracket: str, name: str) -> bool:
        return name.startswith("pybind11") or Path(name).name == "Python.h"

    assert offenders(cpp_files(""), is_pythons) == []


def test_only_the_ode_solver_knows_sundials() -> None:
    heads = {"sundials", "cvode", "nvector", "sunmatrix", "sunlinsol", "sunnonlinsol", "arkode", "ida"}
    users = {
        file.relative_to(ROOT).as_posix()
        for file in cpp_files("")
        for _, name in includes(file)
        if "/" in name and name.split("/")[0] in heads
    }
    assert users == {"cpp/src/plant/feed_drive/ode.cpp"}


def cmake_list(name: str) -> list[str]:
    found = re.search(rf"^set\({name}\s+([^)]*)\)", (ROOT / "CMakeLists.txt").read_text(encoding="utf-8"), re.MULTILINE)
    return found[1].split()


def test_what_a_control_embeds_knows_nothing_of_the_rest() -> None:
    """The library shapegcode_rt: its folders include each other, the standard library and Eigen alone."""
    folders, headers = cmake_list("rt_folders"), cmake_list("rt_headers")
    files = [file for file in cpp_files("include", "src") if own_folder(file) in folders and file.name not in UMBRELLAS]
    assert sorted(headers) == sorted(file.name for file in files if file.is_relative_to(CPP / "include"))

    def is_foreign(_file: Path, bracket: str, name: str) -> bool:
        if bracket == '"':
            return included_folder(name) not in folders
        return "/" in name and not name.startswith("Eigen/")

    assert offenders(files, is_foreign) == []


def test_cpp_folders_use_only_whom_they_may() -> None:
    files = [file for file in cpp_files("include", "src") if file.name not in UMBRELLAS]
    for file in files:
        assert own_folder(file) in FOLDERS, f"{file.relative_to(ROOT)}: say in FOLDERS where {own_folder(file)} stands"

    def is_above(file: Path, bracket: str, name: str) -> bool:
        folder = own_folder(file)
        allowed = set(FOLDERS[: FOLDERS.index(folder) + 1]) - NOT_FROM.get(folder, set())
        return bracket == '"' and (included_folder(name) not in allowed or Path(name).name in UMBRELLAS)

    assert offenders(files, is_above) == []


def test_headers_are_included_by_their_whole_path() -> None:
    """Public ones with the name of the library, private ones as they lie in cpp/src, which no public one may do."""

    def is_short(file: Path, bracket: str, name: str) -> bool:
        is_private = file.is_relative_to(CPP / "src") and (CPP / "src" / name).is_file()
        return bracket == '"' and not name.startswith("shapegcode/") and not is_private

    assert offenders(cpp_files("include", "src"), is_short) == []


# What stands at the root of the package; its folders and who may import whom are import-linter's (pyproject.toml).
ROOT_MODULES = {"__init__", "__main__", "errors", "hints", "_core"}


def test_the_root_of_the_package_stays_small() -> None:
    assert {file.stem for file in PACKAGE.glob("*.py*")} <= ROOT_MODULES


def loaded_after(statement: str) -> set[str]:
    """The top-level modules that a fresh interpreter has loaded after the statement."""
    code = f"import sys\n{statement}\nprint(*(name.split('.')[0] for name in sys.modules))"
    run = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=False)
    assert run.returncode == 0, run.stderr
    return set(run.stdout.split())


def test_shapely_is_loaded_with_the_first_shape() -> None:
    assert "shapely" not in loaded_after("import shapegcode.cutting.material")


HEAVY = {"numpy", "scipy", "matplotlib", "pydantic", "rich"}


@pytest.mark.parametrize(
    "statement",
    [
        "import shapegcode, shapegcode.cli",
        # What `shapegcode --help` does; its text goes to stderr here, so that only the modules are on stdout.
        "import contextlib, shapegcode.cli\n"
        "sys.argv = ['shapegcode', '--help']\n"
        "with contextlib.redirect_stdout(sys.stderr), contextlib.suppress(SystemExit):\n"
        "    shapegcode.cli.main()",
    ],
    ids=["import", "help"],
)
def test_the_command_line_starts_light(statement: str) -> None:
    assert loaded_after(statement) & HEAVY == set()


def test_ten_lines_are_converted_without_what_takes_long_to_load(tmp_path: Path) -> None:
    """Nor do a choice of shapers, a check and a cycle time load SciPy."""
    program = tmp_path / "ten.nc"
    square = ("G01 Z0. F1000.", "G01 X40. Y0. F3000.", "X40. Y30.", "G03 X20. Y50. R20.", "G01 X0. Y50.", "X0. Y0.")
    program.write_text("\n".join(("G21 G17 G90 G54", "G00 X0. Y0. Z5.", *square, "G00 Z5.", "M30", "")))
    output = tmp_path / "shaped.nc"
    commands = [
        ["convert", str(program), "-m", "vx500", "-o", str(output)],
        ["check", str(program), "-m", "vx500"],
        ["time", str(program), "-m", "vx500"],
        ["shaper", "--mode", "46:0.02", "--mode", "80:0.02"],
    ]
    loaded = loaded_after(
        "import contextlib\nfrom shapegcode.cli import main\n"
        f"with contextlib.redirect_stdout(sys.stderr):\n    for words in {commands!r}:\n        assert main(words) < 2"
    )
    assert loaded & {"scipy", "shapely", "matplotlib", "plotly", "pandas", "xarray", "pyuff"} == set()
    assert REGION_MARK in output.read_text(encoding="ascii")  # it was shaped


@pytest.mark.parametrize("page", write_docs.PAGES)
def test_generated_pages_are_up_to_date(page: str) -> None:
    assert (ROOT / "docs" / page).read_text(encoding="utf-8") == write_docs.PAGES[page](), "run `make docs`"


def test_versions_agree() -> None:
    """Of the tag, or of an archive: CMake and pip read it by the same rules."""
    said = subprocess.run(["cmake", "-P", ROOT / "cmake/version.cmake"], capture_output=True, text=True, check=True)
    assert said.stdout.strip() == shapegcode_version.version()
    assert importlib.metadata.version("shapegcode") == said.stdout.strip(), "installed package is stale"
    citation = (ROOT / "CITATION.cff").read_text(encoding="utf-8")
    assert f"version: {said.stdout.strip()}" in citation


def test_the_version_is_that_of_the_last_tag(tmp_path: Path) -> None:
    """Without tags, and in an archive, it is the one that the sources name."""
    clone = tmp_path / "clone"
    (clone / "cmake").mkdir(parents=True)
    script = clone / "cmake" / "version.cmake"
    script.write_bytes((ROOT / "cmake/version.cmake").read_bytes())

    def both() -> set[str]:
        said = subprocess.run(["cmake", "-P", script], capture_output=True, text=True, check=True)
        return {said.stdout.strip(), shapegcode_version.version(clone)}

    def git(*words: str) -> None:
        name = ["-c", "user.name=a", "-c", "user.email=a@b", "-c", "commit.gpgsign=false"]
        subprocess.run(["git", *name, *words], cwd=clone, check=True, capture_output=True)

    (fallback,) = both()
    assert re.fullmatch(r"\d+\.\d+\.\d+", fallback)
    git("init", "-q")
    git("commit", "-q", "--allow-empty", "-m", "a")
    assert both() == {fallback}
    git("tag", "v3.4.5")
    git("commit", "-q", "--allow-empty", "-m", "b")
    git("tag", "other-9.9.9")
    assert both() == {"3.4.5"}
    (clone / "PKG-INFO").write_text("Metadata-Version: 2.1\nName: shapegcode\nVersion: 7.0.1\n")
    shutil.rmtree(clone / ".git")
    assert shapegcode_version.version(clone) == "7.0.1"


def test_the_long_checks_run_for_what_changed(tmp_path: Path) -> None:
    """A source: all, and clang-tidy of its folder alone; a Python test, or one that is gone: the Python tests."""
    texts = [f"cpp/src/{name}" for name in ("a/x.cpp", "a/y.hpp", "b/z.cpp")]
    texts += ["tests/python/test_t.py", "tests/python/test_u.py"]
    for name in (*texts, "tests/tools/full_pass.py", "CMakeLists.txt"):
        (tmp_path / name).parent.mkdir(parents=True, exist_ok=True)
        (tmp_path / name).write_text(f"{name}\n")
    shutil.copy(ROOT / "tests/tools/full_pass.py", tmp_path / "tests/tools")
    subprocess.run(["git", "init", "-q"], cwd=tmp_path, check=True)

    def said(command: str) -> list[str]:
        words = [sys.executable, "tests/tools/full_pass.py", *command.split()]
        return subprocess.run(words, cwd=tmp_path, check=True, capture_output=True, text=True).stdout.split()

    assert said("changed") == ["core", "python"]  # nothing ever passed
    said("write")
    assert len((tmp_path / "tests/full_pass.txt").read_text().splitlines()) == 6
    assert (said("changed"), said("files")) == ([], [])
    (tmp_path / texts[0]).write_text("other")
    assert (said("changed"), said("files")) == (["core", "python"], texts[:2])
    said("write tidy")
    assert (said("changed"), said("files")) == (["core", "python"], [])
    (tmp_path / texts[0]).write_text(f"{texts[0]}\n")
    assert (said("changed"), said("files")) == ([], texts[:2])
    said("write")
    (tmp_path / texts[4]).unlink()
    assert (said("changed"), said("files")) == (["python"], [])
    said("write")
    (tmp_path / "cpp/src/b/new.cpp").write_text("new")
    assert said("files") == ["cpp/src/b/new.cpp", texts[2]]


def files_with(words: str, *folders: str) -> list[str]:
    """The test files, but for this one, in which a pattern is found."""
    files = (file for folder in folders for file in (ROOT / "tests" / folder).rglob("*.py"))
    return [
        file.name for file in files if file != Path(__file__) and re.search(words, file.read_text(encoding="utf-8"))
    ]


def test_no_test_skips_silently() -> None:
    assert files_with(r"importorskip|pytest\.skip|mark\.skip", "python", "oracles") == []


def test_no_test_has_a_limit_in_wall_clock_time() -> None:
    """It would fail on a busy machine: effort.cpu_s compares CPU times instead."""
    assert files_with(r"perf_counter|monotonic|time\.time\(|\btimeout\b", "python") == []


def says_something(name: str, doc: str | None) -> bool:
    """Whether a docstring holds more than the signatures that pybind11 puts there."""
    signature = re.compile(rf"(\d+\. )?{re.escape(name)}\(.*\)( -> .*)?|Overloaded function\.")
    return any(line.strip() and not signature.fullmatch(line.strip()) for line in (doc or "").splitlines())


def test_every_public_name_of_the_extension_is_documented() -> None:
    from shapegcode import _core

    silent = []
    for name, value in vars(_core).items():
        if name.startswith("_") or inspect.ismodule(value):
            continue
        if inspect.isclass(value):
            if not says_something(name, value.__doc__):
                silent.append(name)
            members = {} if issubclass(value, BaseException) else vars(value)
            silent += [
                f"{name}.{member_name}"
                for member_name, member in members.items()
                if not member_name.startswith("_")
                and (callable(member) or isinstance(member, property | staticmethod))
                # of an enumeration: its values, and what pybind11 gives each of them
                and not isinstance(member, value)
                and not (hasattr(value, "__members__") and member_name in {"name", "value"})
                and not says_something(member_name, member.__doc__)
            ]
        elif callable(value) and not says_something(name, value.__doc__):
            silent.append(name)
    assert silent == []


def test_no_two_classes_share_a_name() -> None:
    """Those that the package takes from the core into its public names count as its own."""
    import shapegcode as sg

    classes = [value for name in sg.__all__ if inspect.isclass(value := getattr(sg, name))]
    homes = {value.__name__: ["core"] for value in classes if value.__module__ == "shapegcode._core"}
    for file in sorted(PACKAGE.rglob("*.py")):
        for name in re.findall(r"^ *class (\w+)", file.read_text(encoding="utf-8"), re.MULTILINE):
            homes.setdefault(name, []).append(file.relative_to(PACKAGE).as_posix())
    assert {name: files for name, files in homes.items() if len(files) > 1} == {}


def test_every_plot_of_a_result_is_public_and_draws_into_axes() -> None:
    import shapegcode as sg

    found = [
        (name, function)
        for file in sorted(PACKAGE.glob("*/plots.py"))
        for name, function in public_functions(file)
        if name.startswith("plot_")
    ]
    assert len(found) > 20
    assert [name for name, _ in found if name not in sg.__all__] == []
    for name, function in found:
        assert "ax" in parameters_of(function), name
        assert ast.unparse(function.returns or ast.Constant(None)) == "Axes", name


def public_functions(file: Path) -> Iterator[tuple[str, ast.FunctionDef]]:
    """The functions of a module and the methods of its classes that anybody may call, without properties."""
    for node in ast.parse(file.read_text(encoding="utf-8")).body:
        owner = f"{node.name}." if isinstance(node, ast.ClassDef) else ""
        for member in node.body if isinstance(node, ast.ClassDef) else [node]:
            if isinstance(member, ast.FunctionDef) and not owner.startswith("_") and not member.name.startswith("_"):
                marks = {ast.unparse(mark).partition("(")[0] for mark in member.decorator_list}
                if not marks & {"overload", "property", "field_validator"}:
                    yield owner + member.name, member


def parameters_of(function: ast.FunctionDef) -> set[str]:
    given = function.args
    every = [*given.posonlyargs, *given.args, *given.kwonlyargs, given.vararg, given.kwarg]
    return {each.arg for each in every if each is not None} - {"self", "cls"}


def described_parameters(function: ast.FunctionDef) -> set[str]:
    """The names under ``Args:``."""
    section = re.search(r"^Args:\n((?:    .*\n?|\n(?=    ))*)", ast.get_docstring(function) or "", re.MULTILINE)
    heads = re.findall(r"^    (\w+(?:, \w+)*):", section[1], re.MULTILINE) if section else []
    return {name for head in heads for name in head.split(", ")}


def silent_on(function: ast.FunctionDef) -> list[str]:
    """What a docstring does not say; a function without arguments says what it gives in its first line."""
    doc, takes = ast.get_docstring(function) or "", parameters_of(function)
    gives = function.returns is not None and ast.unparse(function.returns) not in {"None", "NoReturn"}
    raised = {ast.unparse(node.exc) for node in ast.walk(function) if isinstance(node, ast.Raise) and node.exc}
    lacks = [f"Args: {name}" for name in sorted(takes - described_parameters(function))]
    if takes and gives and not re.search(r"^(Returns|Yields):", doc, re.MULTILINE):
        lacks.append("Returns")
    return [*lacks, "Raises"] if raised - {"NotImplementedError"} and "Raises:" not in doc else lacks


def test_public_names_say_what_they_take_what_they_give_and_what_they_raise() -> None:
    import shapegcode as sg

    exported: dict[Path, set[str]] = {}
    for name in sg.__all__:
        value = getattr(sg, name)
        if (inspect.isclass(value) or inspect.isfunction(value)) and value.__module__.count(".") > 1:
            exported.setdefault(Path(inspect.getfile(value)), set()).add(name)
    offenders = [
        f"{file.relative_to(PACKAGE)}: {name}: {lacks}"
        for file, names in exported.items()
        for name, function in public_functions(file)
        if name.partition(".")[0] in names and (lacks := silent_on(function))
    ]
    assert offenders == []


ENTERED = """
import sys

entered, (package, program, output) = set(), sys.argv[1:]

def note(frame, event, argument):
    if frame.f_code.co_filename.startswith(package):
        entered.add(frame.f_code.co_filename)

import threading
threading.settrace(note)
sys.settrace(note)
from shapegcode.cli import main
main(["convert", program, "-m", "vx500", "-o", output, "-q"])
sys.settrace(None)
print(len(entered), file=sys.stderr)
"""
"""Counts the files of the package in which a line is executed by a conversion."""


def test_four_moves_are_converted_by_few_files(tmp_path: Path) -> None:
    program = tmp_path / "four.nc"
    program.write_text("%\nO1\nG21 G90 G17 G54\nG00 X0 Y0 Z-1.\nG01 X40. F3000.\nY30.\nX0.\nY0.\nM30\n%\n")
    words = [sys.executable, "-c", ENTERED, str(PACKAGE), str(program), str(tmp_path / "out.nc")]
    run = subprocess.run(words, capture_output=True, text=True, check=False)
    assert run.returncode == 0, run.stderr
    assert int(run.stderr.split()[-1]) <= 60
