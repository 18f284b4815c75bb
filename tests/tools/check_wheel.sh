#!/bin/bash
# A wheel as a stranger installs it: `check_wheel.sh PYTHON WHEEL`. A fresh venv, a PATH with nothing but its folder, an
# empty home, another working folder. What runs there needs the core, SUNDIALS (feed drives) and SciPy (identification).
set -euo pipefail

python=$1
wheel=$(realpath "$2")
root=$(cd "$(dirname "$0")/../.." && pwd)
work=$(mktemp -d)
trap 'rm -rf "$work"' EXIT

"$python" -m venv "$work/venv"
"$work/venv/bin/python" -m pip --disable-pip-version-check -q install "$wheel"
cp "$root/tests/golden/programs/TEST_G90.NC" "$work/part.nc"
cd "$work"
run() { env -i PATH="$work/venv/bin" HOME="$work" LANG=C.UTF-8 "$@"; }

run shapegcode --version
run shapegcode demo path --quiet
run "$work/venv/bin/python" - >stop.csv <<'PYTHON'
"""A decay of 46 Hz, 2 % damped."""
import math
print("time [s],acc_x [m/s^2]")
for t in (i / 1000 for i in range(2000)):
    print(f"{t},{math.exp(-5.8 * t) * math.sin(289 * t):.9g}")
PYTHON
run shapegcode identify stop.csv --axis x --quiet
run shapegcode simulate part.nc -m vx500 --plant feed-drive --quiet
run shapegcode convert part.nc -m vx500 -o out.nc --html out.html --quiet
run "$work/venv/bin/python" - <<'PYTHON'
"""The libraries that the module needs, and what the wheel says it holds."""
import json
import re
from importlib import metadata
from pathlib import Path

import shapegcode._core as core

# Names of shared libraries stand in the dynamic section as they are.
needed = set(re.findall(rb"lib[\w+-]+\.so\.\d+", Path(core.__file__).read_bytes()))
assert not {name for name in needed if b"fmt" in name or b"sundials" in name}, needed
files = metadata.files("shapegcode")
(sbom,) = (file for file in files if file.name == "shapegcode.cdx.json")
assert sbom.parent.name == "sboms", sbom
bill = json.loads(sbom.read_text())
held = {part["name"]: part["version"] for part in bill["components"]}
assert set(held) == {"Eigen", "fmt", "SUNDIALS", "pybind11"}, held
assert all(re.fullmatch(r"\d+\.\d+(\.\d+)?", version) for version in held.values()), held
assert bill["metadata"]["component"]["version"] == metadata.version("shapegcode") == core.__version__
licences = {file.name for file in files if "licenses" in file.parts}
assert {"LICENSE", *(f"{name}.txt" for name in held)} <= licences, licences
print(f"{len(files)} files; compiled in: {', '.join(f'{name} {version}' for name, version in sorted(held.items()))}")
PYTHON
