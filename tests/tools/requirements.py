"""Prints requirements of pyproject.toml: `requirements.py [build] [runtime] [dev] [docs] [fuzz] [peers]`."""

import sys
import tomllib
from pathlib import Path

project = tomllib.loads((Path(__file__).resolve().parents[2] / "pyproject.toml").read_text(encoding="utf-8"))
groups = {
    "build": project["build-system"]["requires"],
    "runtime": project["project"]["dependencies"],
    **project["dependency-groups"],
}
for name in sys.argv[1:]:
    print(*groups[name], sep="\n")
