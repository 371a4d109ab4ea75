#!/bin/bash
# Configures and builds into build/PRESET; silent when nothing changed.
# usage: tools/build.sh [PRESET]      release (the default), mpi, debug, asan, tsan, werror, coverage or flang
set -euo pipefail

preset=${1:-release}
cd "$(dirname "${BASH_SOURCE[0]}")/.."
build=build/$preset
mkdir -p "$build"
log=$build/build.log

fail() {
  cat "$log" >&2
  echo "build: failed; the log is $PWD/$log" >&2
  exit 1
}
# A build folder that was moved or copied here is of no use.
if [[ -f $build/CMakeCache.txt ]] && ! grep -qxF "CMAKE_HOME_DIRECTORY:INTERNAL=$PWD" "$build/CMakeCache.txt"; then
  rm -rf "$build"
  mkdir -p "$build"
fi
if [[ ! -f $build/build.ninja ]]; then
  echo "build: building dotyk ($preset) in $PWD/$build" >&2
  cmake --preset "$preset" > "$log" 2>&1 || fail
fi
cmake --build "$build" > "$log" 2>&1 || fail
warnings=$(grep -ci '^warning:\|: warning:' "$log" || true)
((warnings == 0)) || echo "build: $warnings warnings in $PWD/$log" >&2
