"""Signatures of core functions and classes for `inspect.signature`, `help` and editors."""

from __future__ import annotations

import ast
import functools
import inspect
import re
from typing import Any, TypeVar

from shapegcode import _core

T = TypeVar("T")


def with_signature(value: T) -> T:
    """Set the signature of a core function or class from its docstring."""
    if isinstance(value, type):
        if not issubclass(value, BaseException) and (found := _signature(value.__init__.__doc__)):
            taken = list(found.parameters.values())[1:]  # without self
            shown = found.replace(parameters=taken, return_annotation=inspect.Signature.empty)
            setattr(value, "__signature__", shown)  # noqa: B010
        return value
    if not inspect.isbuiltin(value) or not (found := _signature(value.__doc__)):
        return value

    @functools.wraps(value)
    def called(*args: Any, **kwargs: Any) -> Any:
        return value(*args, **kwargs)

    called.__module__ = "shapegcode"
    called.__doc__ = (value.__doc__ or "").partition("\n\n")[2].strip()
    setattr(called, "__signature__", found)  # noqa: B010
    return called  # type: ignore[return-value]


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
    return ast.literal_eval(default)


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
