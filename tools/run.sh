#!/bin/bash
# Installs what is missing, builds what changed, and solves one case.
# usage: tools/run.sh CASE.nml [dotyk options]      `tools/run.sh --help` tells them; the exit code is dotyk's
set -euo pipefail

tools=$(cd "$(dirname "${BASH_SOURCE[0]}")" && pwd)
if (($# == 0)); then
  echo "usage: tools/run.sh CASE.nml [dotyk options]: installs what is missing, builds what changed, and solves the case" >&2
  exit 2
fi
"$tools/setup.sh" --run
"$tools/build.sh" release
exec "$tools/../build/release/dotyk" "$@"
