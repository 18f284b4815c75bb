"""Write docs/schema/: the JSON Schema of every result, from its class. `make schemas` calls this."""

from __future__ import annotations

import importlib
import pkgutil
from pathlib import Path

import shapegcode
from shapegcode.cli.machine import FILES, file_schema
from shapegcode.results.json import schema, to_text
from shapegcode.results.result import Result

FOLDER = Path(__file__).resolve().parents[2] / "docs" / "schema"


def results() -> dict[str, type[Result]]:
    """Every kind of result by its name."""
    for module in pkgutil.walk_packages(shapegcode.__path__, "shapegcode."):
        if module.name.endswith(("result", "demos.path")) and ".cli" not in module.name:
            importlib.import_module(module.name)

    def below(cls: type[Result]) -> dict[str, type[Result]]:
        found = {}
        for each in cls.__subclasses__():
            found |= {each.__name__: each, **below(each)}
        return found

    return dict(sorted(below(Result).items()))


def file_texts() -> dict[str, str]:
    """Schemas of the TOML files, for editors, by the names of their files."""
    return {f"{kind}.json": file_schema(kind) for kind in FILES}


def texts() -> dict[str, str]:
    """Content of each file of the folder by its name."""
    return {f"{name}.json": to_text(schema(cls)) for name, cls in results().items()}


if __name__ == "__main__":
    FOLDER.mkdir(exist_ok=True)
    for old in FOLDER.glob("*.json"):
        old.unlink()
    for name, text in texts().items():
        (FOLDER / name).write_text(text, encoding="utf-8")
    (FOLDER / "files").mkdir(exist_ok=True)
    for name, text in file_texts().items():
        (FOLDER / "files" / name).write_text(text, encoding="utf-8")
