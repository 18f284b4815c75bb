#!/usr/bin/env bash
# Lines of C++ and Python that the tests run: builds the core with counters into build/coverage, runs the C++ tests and
# pytest (its arguments are this script's) on it, and prints the two shares of lines. Needs the .venv of `make dev`.
set -euo pipefail

root=$(cd "$(dirname "$0")/../.." && pwd)
cd "$root"
python=$root/.venv/bin/python
"$python" -m pip --disable-pip-version-check -q install 'gcovr>=7' 'pytest-cov>=5'
out=build/coverage
cmake -S . -B "$out" -G Ninja -D CMAKE_BUILD_TYPE=None -D SHAPEGCODE_BUILD_TESTS=ON -D SHAPEGCODE_BUILD_PYTHON=ON \
  -D SHAPEGCODE_WARNINGS_AS_ERRORS=OFF -D CMAKE_CXX_FLAGS='-O1 --coverage -fprofile-update=atomic -w' \
  -D Python_EXECUTABLE="$python" -D pybind11_DIR="$("$python" -m pybind11 --cmakedir)" >/dev/null
cmake --build "$out" --target core_tests allocation_tests operator_sessions c_interface c_client_1_0 _core
find "$out" -name '*.gcda' -delete
(cd "$out" && ctest -j "$(nproc)" -E install_tree --output-on-failure | tail -3)

# The package with this module in place of the installed one.
rm -rf "$out/python"
cp -r python "$out/python"
cp "$out"/_core.*.so "$out/python/shapegcode/"
PYTHONPATH=$root/$out/python "$python" -m pytest -p no:cacheprovider -n "$(nproc)" --dist loadfile -q \
  --cov="$root/$out/python/shapegcode" --cov-report= "$@" | tail -8 || true
echo 'Python:'
"$python" -m coverage report --precision=2 | tail -1
echo 'C++:'
"$python" -m gcovr --root . --filter cpp/src --filter cpp/include --object-directory "$out" \
  --gcov-ignore-parse-errors=all --gcov-ignore-errors=all --print-summary --txt "$out/gcovr.txt" | head -1
echo 'C++, of that shapegcode_rt:'
"$python" tests/tools/rt_coverage.py "$out"
rm -f .coverage
