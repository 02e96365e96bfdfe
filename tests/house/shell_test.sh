#!/usr/bin/env bash
# shellcheck disable=SC2016  # fakes expand their own variables
# SPDX-License-Identifier: Apache-2.0
# run-demo, run-tests and run-learning on machines that lack things: a PATH of fakes stands for each machine, nothing
# here is touched. Usage: shell_test.sh PROJECT_ROOT
set -euo pipefail
project=$1
temporary=$(mktemp -d)
trap 'rm -rf "$temporary"' EXIT
failures=0

# machine NAME: a folder with a copy of the scripts and a PATH of its own. Fakes log their arguments.
machine() {
  name=$1
  home=$temporary/$name
  bin=$home/bin
  log=$home/log
  mkdir -p "$bin" "$home/project/cmake"
  : >"$log"
  cp "$project"/run-demo "$project"/run-tests "$project"/run-learning "$project"/CMakePresets.json "$home/project"
  cp "$project"/cmake/{shell.sh,packages.txt,test-packages.txt,python-packages.txt,python.txt} "$home/project/cmake"
  local tool
  for tool in bash sed grep tr sort head awk env nproc dirname readlink cat mkdir rm ls ctest sleep; do
    ln -s "$(type -P "$tool")" "$bin/$tool"
  done
  fake id 'echo "${FAKE_UID:-0}"'
  fake dpkg-query 'for last; do :; done
    if grep -qx "$last" "$FAKE_HOME/installed"; then echo installed; else exit 1; fi'
  fake apt-get 'case "$*" in
    *update*) exit "${FAKE_UPDATE:-0}" ;;
    *install*) [ "${FAKE_INSTALL:-0}" = 0 ] || exit 100
      [ -n "${FAKE_LIE:-}" ] || for last; do echo "$last"; done >>"$FAKE_HOME/installed" ;;
    esac'
  fake cmake 'if [ "$1" = --version ]; then echo "cmake version ${FAKE_CMAKE:-3.25.1}"; fi'
  sed -e 's/#.*//' "$project"/cmake/{packages,test-packages,python-packages}.txt >"$home/installed"
}
fake() {
  printf '#!/usr/bin/env bash\necho "%s $*" >>"$FAKE_HOME/log"\n%s\n' "$1" "$2" >"$bin/$1"
  chmod +x "$bin/$1"
}
lacks() { sed -i "/^$1\$/d" "$home/installed"; }

# run [NAME=VALUE…] SCRIPT: from another folder, without a terminal.
run() {  # [NAME=VALUE…] SCRIPT [ARGUMENT]
  local variables=()
  while [[ $1 == *=* ]]; do variables+=("$1") && shift; done
  status=0
  output=$(cd / && env -i PATH="$bin" FAKE_HOME="$home" CI=true "${variables[@]}" \
    "$home/project/$1" "${@:2}" </dev/null 2>&1) || status=$?
}
expect() {
  local what=$1
  shift
  if ! "$@"; then
    failures=$((failures + 1))
    printf 'FAILED: %s: %s\nstatus %s, output:\n%s\ncalls:\n%s\n\n' "$name" "$what" "$status" "$output" \
      "$(grep -v ^dpkg-query "$log")"
  fi
}
passes() { [ "$status" -eq 0 ]; }
fails() { [ "$status" -ne 0 ]; }
prints() { grep -qF -- "$1" <<<"$output"; }
not_prints() { ! prints "$1"; }
called() { grep -qF -- "$1" "$log"; }
not_called() { ! called "$1"; }

# The programs that the demo runs, and a ctest folder with one test per line "name result".
built() {
  mkdir -p "$home/project/build/release" "$home/project/build/asan"
  printf '#!/usr/bin/env bash\necho "tangere $*" >>"$FAKE_HOME/log"\nexit "${FAKE_PROGRAM:-0}"\n' \
    >"$home/project/build/release/tangere"
  chmod +x "$home/project/build/release/tangere"
  mkdir -p "$home/project/build/venv/bin"  # with what the missing list of python/requirements.txt asks for: nothing
  ln -s "$(type -P true)" "$home/project/build/venv/bin/python"
}
test_in() {  # PRESET COMMAND
  printf 'add_test(io_one "%s")\nset_tests_properties(io_one PROPERTIES LABELS memory)\n' "$(type -P "$2")" \
    >"$home/project/build/$1/CTestTestfile.cmake"
}

machine complete
built
run run-demo
expect "succeeds" passes
expect "says that nothing is missing" prints "All packages"
expect "installs nothing" not_called "apt-get"
expect "runs the main job" called "tangere generate scenes/rolling_ball.xml"
expect "draws" called "tangere plot out/rolling_ball.h5"
expect "builds for this machine" called "cmake --preset release -DTANGERE_ISAS=host"
echo TANGERE_ISAS:STRING=all >"$home/project/build/release/CMakeCache.txt"
run run-demo
expect "keeps the instruction sets of a full build" called "cmake --preset release -DTANGERE_ISAS=all"
run FAKE_PROGRAM=2 run-demo
expect "fails with the program" fails
expect "says what failed" prints "generating the data set failed"
run FAKE_CMAKE=3.22.1 run-demo
expect "refuses an old CMake" fails
expect "names both versions" prints "3.25 or newer is needed, this machine has 3.22"

machine root
built
lacks libtbb-dev
lacks g++
run run-demo
expect "succeeds" passes
expect "says what it installs" prints "as root, because it writes to /usr): g++ libtbb-dev"
expect "refreshes the lists" called " update"
expect "installs only what is missing" called "install -y --no-install-recommends g++ libtbb-dev"
run FAKE_UPDATE=100 run-demo
expect "needs it once" prints "All packages"

machine user_with_sudo
built
fake sudo 'shift; exec "$@"'
lacks cmake
run FAKE_UID=1000 run-demo
expect "succeeds" passes
expect "never waits for a password nobody can type" called "sudo -n env DEBIAN_FRONTEND=noninteractive apt-get"

machine user_without_sudo
lacks cmake
run FAKE_UID=1000 run-demo
expect "fails" fails
expect "says the exact command" prints "As root, run: apt-get update && apt-get install -y cmake"
expect "does not try" not_called "apt-get"

machine stale_lists
built
lacks ninja-build
run FAKE_UPDATE=100 run-demo
expect "goes on without fresh lists" passes
expect "says so" prints "apt-get update failed; trying"

machine offline
lacks ninja-build
run FAKE_UPDATE=100 FAKE_INSTALL=100 run-demo
expect "fails" fails
expect "says what failed" prints "apt-get could not install the packages"
expect "says what to do" prints "apt-get install -y ninja-build"
expect "builds nothing" not_called "cmake --build"

machine apt_lies
lacks ninja-build
run FAKE_LIE=1 run-demo
expect "fails" fails
expect "names what is still missing" prints "still not installed: ninja-build"

machine another_distribution
rm "$bin/dpkg-query"
run run-demo
expect "fails" fails
expect "lists what is needed" prints "libhdf5-dev"

machine tests
built
test_in release true
test_in asan true
run run-tests
expect "passes" passes
ends_with() { grep -qF -- "$1" <<<"$(tail -n 4 <<<"$output")"; }
expect "says what was run" ends_with "Every test of build/release passed"
expect "counts" prints "100% tests passed, 0 tests failed out of 1"
expect "says which suites took longest" prints "The ten slowest suites"
run run-tests --fast
expect "gives the first answer alone" ends_with "Every fast suite of build/release passed"
run run-tests --quick
expect "refuses another argument" prints "unknown argument '--quick'"
test_in asan false
run run-tests --fast
expect "gives the first answer of a sanitizer" ends_with "asan: io_one"
run run-tests
expect "fails when a sanitizer finds something" fails
expect "runs the others all the same" prints "100% tests passed, 0 tests failed out of 1"
expect "names it at the end" ends_with "asan: io_one"
test_in asan true
fake skipping_program 'printf "[ RUN      ] A.Skips\na_test.cpp:1: Skipped\nmpirun is not installed\n\n"
  printf "[  SKIPPED ] A.Skips (0 ms)\n"'
test_in release "$bin/skipping_program"
run run-tests
expect "passes with what was skipped" passes
expect "names what was skipped and why" prints "release: A.Skips: mpirun is not installed"
expect "builds the Python module" called "-DTANGERE_PYTHON=ON -DPython_EXECUTABLE=$home/project/build/venv/bin/python"
rm "$home/project/build/venv/bin/python"
run run-tests
expect "passes without Python" passes
expect "names what was not tested" prints "release: the Python module and its tests"
lacks openmpi-bin
run run-tests
expect "installs what tests need" called "install -y --no-install-recommends openmpi-bin"
lacks openmpi-bin
run FAKE_INSTALL=100 run-tests
expect "fails without what tests need" fails
expect "says what could not be installed" prints "apt-get could not install the packages"
run run-tests
test_in release false
run run-tests
expect "fails with a test" fails
expect "shows it" prints "0% tests passed, 1 tests failed out of 1"
expect "names it at the end" ends_with "release: io_one"
expect "names no older one" not_prints "asan: io_one"
fake failing_program 'printf "[ RUN      ] A.Good\n[       OK ] A.Good (0 ms)\n[ RUN      ] A.Bad/1\n"
  echo "[  FAILED  ] A.Bad/1, where GetParam() = 3 (2 ms)"; exit 1'
test_in release "$bin/failing_program"
run run-tests
expect "names the case that failed" ends_with "release: io_one: A.Bad/1"
fake failing_program 'echo "[ RUN      ] A.Crash"; exit 1'
run run-tests
expect "names the case that crashed" ends_with "release: io_one: A.Crash (did not end)"
: >"$home/project/build/release/CTestTestfile.cmake"
run run-tests
expect "fails when no test ran" fails

machine two-pythons
fake python3 ''
if [ -x /usr/bin/python3 ]; then
  status=0
  output=$(cd "$home/project" && env -i PATH="$bin:/usr/bin" FAKE_HOME="$home" \
    bash -c '. cmake/shell.sh; python3; python_program' 2>&1) || status=$?
  expect "takes the distribution's Python although another one was run" prints "/usr/bin/python3"
fi

machine learning
built
rm "$home/project/build/venv/bin/python"
fake python 'case "$*" in *experiments*) exit "${FAKE_RUNS:-0}" ;; *torch*) exit "${FAKE_TORCH:-0}" ;; esac'
ln -s "$bin/python" "$home/project/build/venv/bin/python"
run run-learning
expect "succeeds" passes
expect "builds the module" called "tangere_python tangere_python_stub"
expect "makes the runs" called "python learning/experiments.py"
expect "writes the tables" called "python learning/report.py --write"
: >"$log"
run FAKE_RUNS=1 run-learning
expect "fails with a run" fails
expect "writes no table of a part" not_called "report.py"
run FAKE_TORCH=1 run-learning
expect "fails without PyTorch" fails
expect "says what is missing" prints "PyTorch is missing"

if [ "$failures" -gt 0 ]; then
  echo "$failures expectations failed"
  exit 1
fi
echo "all expectations met"
