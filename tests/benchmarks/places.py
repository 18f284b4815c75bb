"""Where things are; behind this import the tests' oracles, tools and helpers can be imported too."""

import sys
from pathlib import Path

ROOT = Path(__file__).resolve().parents[2]
TESTS = ROOT / "tests"
GOLDEN = TESTS / "golden" / "programs"
sys.path += [str(TESTS / name) for name in ("oracles", "tools", "python")]
