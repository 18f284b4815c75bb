"""Write the JSON Schema of every result and of the TOML files, from their classes: `write_schemas.py FOLDER [--keys]`.

`make schemas` calls it. `--keys` writes tests/golden/result_keys.txt too: the keys that a test holds stable.
"""

from __future__ import annotations

import importlib
import pkgutil
import sys
from pathlib import Path

import shapegcode
from shapegcode.cli.machine import FILES, file_schema
from shapegcode.results.json import schema, to_text
from shapegcode.results.result import Result

KEYS = Path(__file__).resolve().parents[1] / "golden" / "result_keys.txt"


def results() -> dict[str, type[Result]]:
    """Every kind of result by its name."""
    for module in pkgutil.walk_packages(shapegcode.__path__, "shapegcode."):
        if ".cli" not in module.name and not module.name.endswith("__main__"):
            importlib.import_module(module.name)

    def below(cls: type[Result]) -> dict[str, type[Result]]:
        found = {}
        for each in cls.__subclasses__():
            found |= {each.__name__: each, **below(each)}
        return found

    return dict(sorted(below(Result).items()))


def texts() -> dict[str, str]:
    """Content of each file by its name below the folder: of results, and under files/ of TOML files, for editors."""
    found = {f"{name}.json": to_text(schema(cls)) for name, cls in results().items()}
    return found | {f"files/{kind}.json": file_schema(kind) for kind in FILES}


def keys() -> str:
    """The keys of each object of the results, a line each; `?` behind one that may be left out."""
    objects: dict[str, str] = {}
    kinds = results()
    for name, cls in kinds.items():
        whole = schema(cls)
        parts = {part: found for part, found in whole.get("$defs", {}).items() if part not in kinds}
        for part, found in {name: whole, **parts}.items():
            if "properties" in found:
                required = found.get("required", ())
                words = " ".join(key if key in required else f"{key}?" for key in sorted(found["properties"]))
                assert objects.setdefault(part, words) == words, f"two objects are called {part}"
    return "".join(f"{part}: {words}\n" for part, words in sorted(objects.items()))


def write(folder: Path) -> None:
    """Write the schemas below a folder."""
    (folder / "files").mkdir(parents=True, exist_ok=True)
    for name, text in texts().items():
        (folder / name).write_text(text, encoding="utf-8")


if __name__ == "__main__":
    write(Path(sys.argv[1]))
    if "--keys" in sys.argv:
        KEYS.write_text(keys(), encoding="utf-8")
