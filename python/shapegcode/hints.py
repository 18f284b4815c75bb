"""What was probably meant by a name or an argument that does not exist: `hints.toml`, then the closest name."""

from __future__ import annotations

import functools
import inspect
import re
from collections.abc import Callable, Iterable
from typing import TYPE_CHECKING, Any, NoReturn, TypeVar

F = TypeVar("F", bound=Callable[..., Any])
_WRONG = re.compile(r"unexpected keyword argument '(\w+)'$|positional argument")
_ALL = "()"  # entry of a class or function that is added to the refusal of wrong arguments


def guess(name: str, *owners: str) -> str:
    """``; use ...`` for a name guessed at a module, class or function; empty if none of the owners has an entry."""
    found = (_guesses().get(owner, {}).get(name.lower(), "") for owner in owners)
    return next((f"; use {each}" for each in found if each), "")


@functools.cache
def _guesses() -> dict[str, dict[str, str]]:
    import tomllib
    from importlib import resources

    text = (resources.files("shapegcode") / "hints.toml").read_text(encoding="utf-8")
    tables = tomllib.loads(text).items()
    return {owner: {name: use for names, use in table.items() for name in names.split()} for owner, table in tables}


def hint(name: str, known: Iterable[str], *owners: str) -> str:
    """The guess, or ``; did you mean 'known'?`` with at most two names closest to an unknown one; empty if none is."""
    if name.startswith("_"):  # Python and NumPy ask for many of them
        return ""
    if found := guess(name, *owners):
        return found
    import difflib

    names = sorted(each for each in known if not each.startswith("_"))
    words = set(name.lower().split("_"))
    with_all = sorted((each for each in names if words <= {*each.split("_")}), key=len)
    close = difflib.get_close_matches(name, names, n=1) or difflib.get_close_matches(name.lower(), names, n=1)
    alike = sorted(names, key=lambda each: -len(words.intersection(each.split("_"))))[:1]
    near = with_all[:2] or close or [each for each in alike if words & {*each.split("_")}]
    return f"; did you mean {' or '.join(map(repr, near))}?" if near else ""


def missing_attribute(owner: object, name: str) -> AttributeError:
    """An AttributeError with a hint; `owner` is an object or a class."""
    kind = owner if isinstance(owner, type) else type(owner)
    near = "" if name.startswith("_") else hint(name, dir(owner), *(each.__name__ for each in kind.__mro__))
    what = f"type object {kind.__name__!r}" if owner is kind else f"{kind.__name__!r} object"
    return AttributeError(f"{what} has no attribute {name!r}{near}")


class HintedClass(type):
    """Metaclass whose classes answer an attribute that they do not have with a hint."""

    def __getattr__(cls, name: str) -> NoReturn:
        raise missing_attribute(cls, name)


class Hinted(metaclass=HintedClass):
    """Base of classes that, like their objects, answer an attribute that they do not have with a hint."""

    if not TYPE_CHECKING:

        def __getattr__(self, name: str) -> NoReturn:
            raise missing_attribute(self, name)


def wrong_argument(called: str, name: str, known: Iterable[str], taken: str) -> TypeError:
    """A TypeError on a keyword that a function or class does not have."""
    near = hint(name, known, called) or guess(_ALL, called)
    return TypeError(f"{called}() has no argument {name!r}{near}; it takes {taken}")


def with_hints(function: F) -> F:
    """The function, whose refusal of wrong arguments says which were probably meant."""

    @functools.wraps(function)
    def called(*args: Any, **kwargs: Any) -> Any:
        try:
            value = function(*args, **kwargs)
        except TypeError as error:
            wrong = _WRONG.search(str(error))
            # A deeper traceback: an error inside of the function.
            if wrong is None or error.__traceback__ is None or error.__traceback__.tb_next is not None:
                raise
            name = function.__qualname__.removesuffix(".__init__")
            names = [each for each in inspect.signature(function).parameters if each not in ("cls", "self")]
            taken = ", ".join(names) or "none"
            if wrong[1]:
                raise wrong_argument(name, wrong[1], names, taken) from None
            raise TypeError(f"{error}; it takes {taken}{guess(_ALL, name, function.__name__)}") from None
        with_hints_in(type(value))
        return value

    return called  # type: ignore[return-value]


def with_hints_in(kind: type) -> None:
    """The same for the public methods of a class and its bases in the package, and of what they return."""
    for each in kind.__mro__:
        if "_has_hints" in vars(each):
            return
        if not each.__module__.startswith("shapegcode.") or each.__module__ == "shapegcode._core":
            continue
        if guess(_ALL, each.__name__) and inspect.isfunction(first := vars(each).get("__init__")):
            setattr(each, "__init__", with_hints(first))  # noqa: B010
        for name, member in [*vars(each).items()]:
            if isinstance(member, classmethod) and not name.startswith("_"):
                setattr(each, name, classmethod(with_hints(member.__func__)))
            elif inspect.isfunction(member) and not name.startswith("_"):
                setattr(each, name, with_hints(member))
        setattr(each, "_has_hints", True)  # noqa: B010
