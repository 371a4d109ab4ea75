#!/bin/bash
# Runs many cases, goes on after failures, skips what is done, and ends with a table; `tools/batch.sh --help` tells the options.
# DOTYK=/path/to/dotyk takes that executable in place of the one that is built here.
set -euo pipefail

tools=$(cd "$(dirname "${BASH_SOURCE[0]}")" && pwd)
if [[ -z ${DOTYK:-} && " $* " != *" --help "* ]]; then
  "$tools/setup.sh" --run
  "$tools/build.sh" release
fi
DOTYK=${DOTYK:-$tools/../build/release/dotyk} exec "$tools/python.sh" "$tools/batch.py" "$@"
