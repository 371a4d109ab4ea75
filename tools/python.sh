#!/bin/bash
# Python with h5py and numpy, for the other scripts: $DOTYK_PYTHON, the python3 of the PATH, or Debian's.
# usage: tools/python.sh SCRIPT.py [arguments]
set -euo pipefail

for python in ${DOTYK_PYTHON:+"$DOTYK_PYTHON"} python3 /usr/bin/python3; do
  if command -v "$python" > /dev/null && "$python" -c "import h5py, numpy" 2> /dev/null; then
    exec "$python" -B "$@"
  fi
done
echo "python: no Python with h5py and numpy; tools/setup.sh installs Debian's, DOTYK_PYTHON names another" >&2
exit 1
