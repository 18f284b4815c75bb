"""Coverage-guided fuzzing of the parameter import with atheris; `make fuzz-parameters`."""

from __future__ import annotations

import sys
from pathlib import Path

import atheris

sys.path.insert(0, str(Path(__file__).parent))
with atheris.instrument_imports(include=["shapegcode"]):
    from parameters_check import check_import

if __name__ == "__main__":
    atheris.Setup(sys.argv, check_import)
    atheris.Fuzz()
