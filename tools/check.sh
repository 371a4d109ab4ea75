#!/bin/bash
# Checks that are slower or stricter than tools/test.sh, each in a build folder of its own; what they need goes to build/venv.
# usage: tools/check.sh [PART...]      all parts without any; exit code 1 where one fails
#   lint      fortitude, with the rules of fortitude.toml; spelling of the pages; their links
#   werror    all warnings of the compiler are errors
#   api       the pages that FORD makes of the comments, without a warning: build/api/index.html
#   site      the pages of docs as a site, without a warning: build/site/index.html
#   flang     LLVM's flang builds all layers that need no module file of gfortran, and runs unit tests
#   runners   unit tests under pFUnit (CONTRIBUTING.md) and under the small runner: as many as the .pf files have, both times
#   package   the Python package of tools/python installs by pip, and its tests pass with the h5py and numpy that pip finds
#   slurm     tools/batch.slurm under a Slurm of its own on this machine (tests/slurm); skipped where Slurm is absent
#   quick     small examples of inputs/ under debug, built without tests: a second build for each push
#   scenes    all examples of inputs/ under debug, asan and tsan, likewise: no trap, no bad access, no leak, no race
#   debug     all tests with run-time checks, traps of invalid operations, and signalling NaN
#   asan      all tests with the address and undefined-behaviour sanitizers
#   coverage  lines of src/ that the tests reach: build/coverage/coverage.html
set -uo pipefail

tools=$(cd "$(dirname "${BASH_SOURCE[0]}")" && pwd)
cd "$tools/.."
parts=(lint werror api site flang runners package slurm quick scenes debug asan coverage)

# A Python environment with the tools of check_requirements.txt.
environment() {
  [[ build/venv/done -nt tools/check_requirements.txt ]] && return
  "$tools/setup.sh" --run python3-venv && /usr/bin/python3 -m venv --clear build/venv \
    && build/venv/bin/pip --quiet install --requirement tools/check_requirements.txt && touch build/venv/done
}

lint() {
  environment && build/venv/bin/fortitude check src tests && spelling && /usr/bin/python3 -B tests/support/test_pages.py
}

# Of all pages. Names and words that codespell takes for others are in tools/spelling.txt.
spelling() {
  "$tools/setup.sh" --run codespell || return
  git ls-files -z '*.md' | xargs -0 codespell --ignore-words tools/spelling.txt
}

werror() {
  "$tools/setup.sh" --run && "$tools/build.sh" werror
}

api() {
  environment || return
  rm -rf build/api
  build/venv/bin/ford --quiet tools/ford.md > build/api.log 2>&1 || { cat build/api.log; return 1; }
  if grep -i warning build/api.log; then return 1; fi
}

# The pages and pictures of the repository in their folders, made into a site.
site() {
  environment || return
  rm -rf build/pages build/site
  git ls-files -z '*.md' 'docs/*.png' 'inputs/*.png' | xargs -0 cp --parents -t "$(mkdir -p build/pages && echo build/pages)" || return
  build/venv/bin/mkdocs build --quiet --strict --config-file tools/site.yml
}

flang() {
  "$tools/setup.sh" --run flang-19 libomp-19-dev && cmake --preset flang > build/flang.log || return
  local layers=(base ranks input mesh linalg elasticity contact response scheme)
  cmake --build build/flang --target "${layers[@]/#/dotyk_}" "${layers[@]/#/test_}" > build/flang.log 2>&1 || { tail -n 50 build/flang.log; return 1; }
  # flang 19 loses its way in parallel regions of these sources (CONTRIBUTING.md): one thread, and the tests that need no more.
  OMP_NUM_THREADS=1 ctest --test-dir build/flang --output-on-failure -R '^test_(base|input|elasticity|response|scheme)$'
}

# Both runners must find and pass every test of the .pf files.
runners() {
  local wish
  "$tools/setup.sh" || return
  for wish in ON OFF; do
    local build=build/pfunit_${wish,,}
    cmake --preset release -B "$build" -DDOTYK_PFUNIT=$wish > "$build.log" 2>&1 || { tail -n 20 "$build.log"; return 1; }
    cmake --build "$build" > "$build.log" 2>&1 || { tail -n 50 "$build.log"; return 1; }
    rm -f "$build/Testing/Temporary/LastTest.log"
    ctest --test-dir "$build" --output-on-failure --parallel "$(nproc)" -R '^test_' > "$build.log"
  done
  "$tools/python.sh" "$tools/count_tests.py" build/pfunit_on build/pfunit_off
}

# In an environment of its own.
package() {
  "$tools/setup.sh" --run python3-venv && "$tools/build.sh" release && rm -rf build/package && /usr/bin/python3 -m venv build/package || return
  build/package/bin/pip --quiet install ./tools/python || return
  (cd build/package && bin/python -P -c "import dotyk; assert 'site-packages' in dotyk.__file__, dotyk.__file__") || return
  DOTYK=$PWD/build/release/dotyk PYTHONPATH=tests/support OMP_WAIT_POLICY=passive build/package/bin/python -B tests/cases/package.py
}

# With the program with MPI too, where it is built (cmake --preset mpi).
slurm() {
  "$tools/setup.sh" --run && "$tools/build.sh" release || return
  PYTHONPATH=tests/support OMP_WAIT_POLICY=passive "$tools/python.sh" tests/slurm/jobs.py
}

# run_examples PRESET NAME...: examples in copies of their folders, as many at once as there are cores; under tsan with two
# threads each.
run_examples() {
  "$tools/setup.sh" --run || return
  local preset=$1 build=$PWD/build/$1_scenes threads=1
  [[ $preset != tsan ]] || threads=2
  shift
  cmake --preset "$preset" -B "$build" -DDOTYK_TESTS=OFF > "$build.log" 2>&1 || { tail -n 20 "$build.log"; return 1; }
  cmake --build "$build" > "$build.log" 2>&1 || { tail -n 50 "$build.log"; return 1; }
  rm -rf "$build/inputs" && cp -r inputs "$build"
  find "${@/#/$build/inputs/}" -name '*.nml' -print0 | sanitized xargs -0 -n 1 -P "$(nproc)" bash -c '
    timeout 900 "$0" --quiet --threads "$1" "$2" > "$2.log" 2>&1 && exit
    echo "check: $2: exit code $?" >&2; tail -n 30 "$2.log" >&2; exit 1' "$build/dotyk" "$threads"
}

quick() {
  run_examples debug bearing column composite conrod cylinder groove multilayer press_fit punch receding ssnv104 wavy
}

scenes() {
  run_examples debug . && run_examples asan . && run_examples tsan .
}

sanitized() {
  ASAN_OPTIONS=allocator_may_return_null=1 UBSAN_OPTIONS=halt_on_error=1 \
    LSAN_OPTIONS=print_suppressions=0:suppressions=$PWD/tests/support/lsan.supp \
    TSAN_OPTIONS=suppressions=$PWD/tests/support/tsan.supp "$@"
}

debug() {
  "$tools/test.sh" --preset debug
}

asan() {
  sanitized "$tools/test.sh" --preset asan
}

coverage() {
  environment || return
  find build/coverage -name '*.gcda' -delete 2> /dev/null
  "$tools/test.sh" --preset coverage || return
  build/venv/bin/gcovr --root . --filter src/ --gcov-ignore-parse-errors=all --gcov-ignore-errors=no_working_dir_found --exclude-unreachable-branches \
    --html-nested build/coverage/coverage.html --txt-summary build/coverage
}

(($# > 0)) || set -- "${parts[@]}"
for part in "$@"; do
  if [[ " ${parts[*]} " != *" $part "* ]]; then
    echo "check: no part '$part'; the parts are ${parts[*]}" >&2
    exit 2
  fi
done
mkdir -p build
failed=()
for part in "$@"; do
  echo "check: $part" >&2
  "$part" || failed+=("$part")
done
if ((${#failed[@]} > 0)); then
  echo "check: failed: ${failed[*]}" >&2
  exit 1
fi
echo "check: all passed" >&2
