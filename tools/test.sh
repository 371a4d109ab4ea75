#!/bin/bash
# Installs what is missing, builds what changed, runs all tests and counts them.
# usage: tools/test.sh [--mpi | --preset PRESET] [ctest options]      such as: tools/test.sh --preset debug -R contact
#   --mpi     the program for MPI: tests of several ranks, and of the others those that -R names, on two ranks
set -euo pipefail

tools=$(cd "$(dirname "${BASH_SOURCE[0]}")" && pwd)
preset=release
setup=()
selection=()
if [[ ${1:-} == --mpi ]]; then
  preset=mpi
  setup=(--mpi)
  shift
  (($# > 0)) || selection=(-R '^(test_|mpi_|split_)')
elif [[ ${1:-} == --preset ]]; then
  preset=${2:?"usage: tools/test.sh [--mpi | --preset PRESET] [ctest options]"}
  shift 2
fi
"$tools/setup.sh" "${setup[@]}"
"$tools/build.sh" "$preset"
build=$(cd "$tools/../build/$preset" && pwd)

code=0
rm -f "$build/Testing/Temporary/LastTest.log"
ctest --test-dir "$build" --output-on-failure --parallel "$(nproc)" "${selection[@]}" "$@" || code=$?
# The very last line is "N passed, N failed", over the single tests of all executables.
"$tools/python.sh" "$tools/count_tests.py" "$build" || code=$?
exit "$code"
