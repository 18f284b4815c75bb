"""Signatures of core functions and classes for `inspect.signature`, `help` and editors."""

from __future__ import annotations

import ast
import functools
import inspect
import re
from typing import Any, TypeVar

from shapegcode import _core
from shapegcode.hints import guess, missing_attribute, wrong_argument
from shapegcode.machine.axes import as_mode

T = TypeVar("T")


def with_signature(value: T) -> T:
    """Set the signature of a core function or class from its docstring; wrong arguments are refused by it."""
    _sign_classes()
    if isinstance(value, type) or not inspect.isbuiltin(value) or not (found := _signature(value.__doc__)):
        return value

    @functools.wraps(value)
    def called(*args: Any, **kwargs: Any) -> Any:
        try:
            return value(*args, **kwargs)
        except TypeError as error:
            if "incompatible" not in str(error):  # a callback's own
                raise
            first = error
        try:
            given = _with_modes(found, args, kwargs)
            return value(*given.args, **given.kwargs)
        except TypeError:
            raise _refusal(first, value.__name__, found, args, kwargs) from None

    called.__module__ = "shapegcode"
    called.__doc__ = (value.__doc__ or "").partition("\n\n")[2].strip()
    setattr(called, "__signature__", found)  # noqa: B010
    return called  # type: ignore[return-value]


def _sign_methods(kind: type) -> None:
    for name, member in [*vars(kind).items()]:
        found = _signature(member.__doc__) if name == "__init__" or inspect.isroutine(member) else None
        # `step` is called a thousand times a second.
        if found is None or not found.parameters or (name.startswith("_") and name != "__init__") or name == "step":
            continue
        taken = [each for each in found.parameters.values() if each.name != "self"]
        if name == "__init__":
            found = found.replace(return_annotation=inspect.Signature.empty)
            setattr(kind, "__signature__", found.replace(parameters=taken))  # noqa: B010
        if taken and not isinstance(member, staticmethod):
            called = kind.__name__ if name == "__init__" else name
            method = _refusing(getattr(kind, name), called, found.replace(parameters=taken))
            setattr(method, "__signature__", found)  # noqa: B010
            setattr(kind, name, method)


def _refusing(function: Any, name: str, found: inspect.Signature) -> Any:
    """A method that refuses wrong arguments in one line."""

    @functools.wraps(function)
    def called(self: Any, *args: Any, **kwargs: Any) -> Any:
        try:
            return function(self, *args, **kwargs)
        except TypeError as error:
            raise _refusal(error, name, found, args, kwargs) from None

    return called


@functools.cache
def _sign_classes() -> None:
    """The same for the methods of the core's classes, which also suggest a name for one that they do not have."""

    def missing(self: object, name: str) -> Any:
        raise missing_attribute(self, name)

    for each in vars(_core).values():
        if isinstance(each, type) and not issubclass(each, BaseException):
            setattr(each, "__getattr__", missing)  # noqa: B010
            _sign_methods(each)


def _with_modes(found: inspect.Signature, args: Any, kwargs: Any) -> inspect.BoundArguments:
    """The arguments; where modes are expected, numbers, pairs and identified modes are converted to modes."""
    given = found.bind(*args, **kwargs)
    for name, value in given.arguments.items():
        expected = str(found.parameters[name].annotation)
        if "Mode" in expected.split(" | "):
            given.arguments[name] = _mode(value)
        elif "[Mode]" in expected and not isinstance(value, str | bytes):
            given.arguments[name] = [_mode(each) for each in value]
    return given


def _mode(value: Any) -> Any:
    return _core.Mode(value, 0.0) if isinstance(value, int | float) else as_mode(value)


def _refusal(error: TypeError, name: str, found: inspect.Signature, args: Any, kwargs: Any) -> TypeError:
    """pybind11's list of signatures and arguments in one line."""
    if "incompatible" not in str(error) or not found.parameters:
        return error
    signature = str(found).replace("'", "")
    if unknown := [key for key in kwargs if key not in found.parameters]:
        return wrong_argument(name, unknown[0], found.parameters, signature)
    taken = f"it takes {signature}"
    use = guess("()", name)
    try:
        given = found.bind(*args, **kwargs).arguments
    except TypeError as wrong:
        return TypeError(f"{name}(): {wrong}{use}; {taken}")
    sizes = {key: f"({len(value)})" if isinstance(value, list | tuple) else "" for key, value in given.items()}
    shown = (f"{key}: {type(value).__name__}{getattr(value, 'shape', sizes[key])}" for key, value in given.items())
    return TypeError(f"{name}() was given {', '.join(shown)}{use}; {taken}")


def _signature(doc: str | None) -> inspect.Signature | None:
    """Parse the first docstring line, ``name(first: type, second: type = 1) -> type``; None if there is none."""
    # pybind11 writes the default of an enumeration as <WallSide.right: 0>.
    head = re.sub(r"<(\w+\.\w+): -?\d+>", r"\1", (doc or "").partition("\n")[0])
    try:
        (found,) = ast.parse(f"def {head}: ...").body
    except SyntaxError:
        return None
    if not isinstance(found, ast.FunctionDef):
        return None
    free, named = found.args.args, found.args.kwonlyargs
    defaults = [None] * (len(free) - len(found.args.defaults)) + list(found.args.defaults)
    kinds = inspect.Parameter.POSITIONAL_OR_KEYWORD, inspect.Parameter.KEYWORD_ONLY
    parameters = [
        inspect.Parameter(each.arg, kind, default=_value(default), annotation=_words(each.annotation))
        for kind, arguments, given in ((kinds[0], free, defaults), (kinds[1], named, found.args.kw_defaults))
        for each, default in zip(arguments, given, strict=True)
    ]
    return inspect.Signature(parameters, return_annotation=_words(found.returns))


def _value(default: ast.expr | None) -> Any:
    """Evaluate a default: a literal, inf, or a member of a core enumeration."""
    if default is None:
        return inspect.Parameter.empty
    if isinstance(default, ast.Name):
        return float(default.id)
    if isinstance(default, ast.Attribute) and isinstance(default.value, ast.Name):
        return getattr(getattr(_core, default.value.id), default.attr)
    return ... if isinstance(default, ast.Call) else ast.literal_eval(default)  # an object of the core, as in the stub


class _Short(ast.NodeTransformer):
    """``typing.Annotated[numpy.typing.ArrayLike, ...]`` as ``ArrayLike``: without modules and annotations."""

    def visit_Subscript(self, node: ast.Subscript) -> ast.AST:
        """The type inside ``Annotated``; other subscripts unchanged."""
        noted = ast.unparse(node.value) == "typing.Annotated" and isinstance(node.slice, ast.Tuple)
        self.generic_visit(node)
        return node.slice.elts[0] if noted and isinstance(node.slice, ast.Tuple) else node

    def visit_Attribute(self, node: ast.Attribute) -> ast.AST:
        """The name without its modules."""
        return ast.Name(node.attr)


def _words(annotation: ast.expr | None) -> Any:
    if annotation is None:
        return inspect.Parameter.empty
    text = ast.unparse(_Short().visit(annotation))
    # Replace the core's names for numbers by readable ones.
    text = text.replace("SupportsFloat | SupportsIndex", "float")
    return text.replace("SupportsInt | SupportsIndex", "int")
