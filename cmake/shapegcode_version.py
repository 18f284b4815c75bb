"""Version of the Python package, for scikit-build-core: the last tag of git; of an archive what stands in it.

The rules are those of cmake/version.cmake, whose number for clones without tags it reads.
"""

from __future__ import annotations

import re
import subprocess
from collections.abc import Mapping
from pathlib import Path
from typing import Any

__all__ = ["dynamic_metadata", "version"]

ROOT = Path(__file__).resolve().parents[1]
_NUMBER = re.compile(r"\d+\.\d+\.\d+")


def version(root: Path = ROOT) -> str:
    """The version of a source tree.

    Args:
        root: of the tree.

    Returns:
        Three numbers with points.
    """
    if (root / ".git").exists():
        command = ["git", "describe", "--tags", "--abbrev=0", "--match", "v[0-9]*.[0-9]*.[0-9]*"]
        try:
            tag = subprocess.run(command, cwd=root, capture_output=True, text=True, check=False).stdout
        except OSError:
            tag = ""  # no git
        if found := _NUMBER.search(tag):
            return found[0]
    else:
        metadata = root / "PKG-INFO"
        if metadata.is_file() and (written := re.search(r"^Version: (\S+)$", metadata.read_text(), re.MULTILINE)):
            return written[1]
    script = (root / "cmake" / "version.cmake").read_text()
    fallback = re.search(r"set\(version_without_tags (\S+)\)", script)
    assert fallback is not None
    return fallback[1]


def dynamic_metadata(field: str, settings: Mapping[str, Any] | None = None) -> str:
    """What scikit-build-core calls.

    Args:
        field: of the metadata: "version".
        settings: there are none.

    Returns:
        The version.

    Raises:
        RuntimeError: another field.
    """
    if field != "version" or settings:
        raise RuntimeError(f"{field}: only the version comes from here, without settings")
    return version()
