"""None in place of an object of the core is refused: it has no value to read."""

import ast
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np

from shapegcode import _core

STUB = Path(_core.__file__).parent / "_core.pyi"
# By a part of the annotation.
EXAMPLES: dict[str, Any] = {
    "[3, 1]": [0.0, 0.0, 0.0],
    "[m, 1]": [0.0],
    "NDArray": np.zeros((2, 3)),
    "ArrayLike": np.zeros((2, 3)),
}
SQUARE = b"%\nO1\nG90G94G17G21G54\nG00X0Y0Z0\nG01X10.F600\nY10.\nM30\n%\n"


def core_class(annotation: ast.expr) -> str | None:
    """Name of the class of the core that an annotation asks for."""
    if isinstance(annotation, ast.Name) and isinstance(getattr(_core, annotation.id, None), type):
        return annotation.id
    return None


def known(name: str) -> Any:
    """Objects whose constructor asks for what no rule gives."""
    path = _core.Path(
        [_core.Segment.line([0, 0, 0], [10, 0, 0], 10.0), _core.Segment.line([10, 0, 0], [10, 10, 0], 10)]
    )
    if name == "Path":
        return path
    if name == "SpeedProfile":
        return _core.plan_speed(path, _core.MotionLimits())
    if name == "Mode":
        return _core.Mode(46.0, 0.02)
    if name == "Shaper":
        return _core.Shaper([0.0, 0.01], [0.5, 0.5])
    if name == "Fir":
        return _core.Fir([0, 1], [0.5, 0.5])
    if name == "Segment":
        return path[0]
    if name == "ProgramText":
        return _core.read_program(SQUARE)
    if name == "ModeTable":
        return _core.ModeTable(0, [0.0], [40.0])
    if name == "EndMill":
        return _core.EndMill(4.0, 2)
    if name == "Material":
        return _core.Material([np.array([[-5.0, -5.0], [15.0, -5.0], [15.0, 15.0], [-5.0, 15.0]])], [-1.0, 1.0], 0.5)
    if name == "EngagementTrack":
        return _core.sweep(known("Material"), path, 4.0)
    raise KeyError(name)


def example(annotation: ast.expr | None, depth: int = 0) -> Any:
    """A value that converts to an annotated type."""
    text = "" if annotation is None else ast.unparse(annotation)
    name = None if annotation is None else core_class(annotation)
    if name is not None:
        return instance(name, depth + 1)
    if text.endswith("| None"):
        return None
    for part, value in EXAMPLES.items():
        if part in text:
            return value
    if "Callable" in text:
        return lambda *_: True
    if text.startswith("collections.abc.Sequence[") and isinstance(annotation, ast.Subscript):
        return [example(annotation.slice, depth)]
    if text == "bool":
        return False
    if text == "str":
        return "a"
    if text == "bytes":
        return SQUARE
    if "SupportsFloat" in text:
        return 1.0
    if "SupportsI" in text or text == "int":
        return 1
    return None


def instance(name: str, depth: int = 0) -> Any:
    """An object of a class of the core."""
    cls = getattr(_core, name)
    if hasattr(cls, "__members__"):
        return next(iter(cls.__members__.values()))
    try:
        return known(name)
    except KeyError:
        pass
    if depth > 3:
        return None
    for kind, function in FUNCTIONS:
        if kind == name and function.name == "__init__":
            try:
                return cls(*[example(a.annotation, depth) for a in function.args.args[1:]])
            except (TypeError, _core.ShapegcodeError):
                continue
    return None


def functions() -> Iterator[tuple[str, ast.FunctionDef]]:
    """Functions of the core and methods of its classes, without properties."""
    for node in ast.parse(STUB.read_text()).body:
        members = node.body if isinstance(node, ast.ClassDef) else [node]
        for member in members:
            if isinstance(member, ast.FunctionDef) and not any(
                "property" in ast.unparse(d) or "setter" in ast.unparse(d) for d in member.decorator_list
            ):
                yield (node.name if isinstance(node, ast.ClassDef) else ""), member


FUNCTIONS = list(functions())


def walk() -> int:
    """Pass None for every argument that is an object of the core; returns how many there were."""
    asked = 0
    for kind, function in FUNCTIONS:
        if function.name.startswith("__") and function.name != "__init__":
            continue
        owner: Any = getattr(_core, kind) if kind else _core
        called: Any = owner if function.name == "__init__" else getattr(owner, function.name)
        static = any(ast.unparse(d) == "staticmethod" for d in function.decorator_list)
        arguments = function.args.args
        bound: list[Any] = []
        if kind and not static:
            arguments = arguments[1:]
            if function.name != "__init__":
                bound = [instance(kind)]
        defaults = [None] * (len(arguments) - len(function.args.defaults)) + list(function.args.defaults)
        for at, (argument, default) in enumerate(zip(arguments, defaults, strict=True)):
            if argument.annotation is None or core_class(argument.annotation) is None:
                continue
            if isinstance(default, ast.Constant) and default.value is None:
                continue  # None has a meaning there
            values = [None if i == at else example(a.annotation) for i, a in enumerate(arguments)]
            print(f"{kind}.{function.name}({argument.arg}=None)", flush=True)
            try:
                called(*bound, *values)
            except TypeError:
                asked += 1
                continue
            raise AssertionError(f"{kind}.{function.name} takes None as {argument.arg}")
    return asked


def test_none_is_no_object_of_the_core() -> None:
    """In a process of its own: reading nothing would end it."""
    script = "import test_none; print('asked', test_none.walk())"
    done = subprocess.run(
        [sys.executable, "-c", script], cwd=Path(__file__).parent, capture_output=True, text=True, check=False
    )
    assert done.returncode == 0, done.stdout[-300:] + done.stderr[-2000:]
    assert int(done.stdout.split()[-1]) > 60
    for function in ("simulate_path(path", "simulate_blocks(blocks", "simulate_samples(path", "time_program(program"):
        assert f".{function}=None)" in done.stdout
