# shellcheck shell=bash
# SPDX-License-Identifier: Apache-2.0
# What ./run-demo and ./run-tests share: the packages, the build, the way to fail. Sourced from the project's root.

say() { printf '%s\n' "$*"; }
# Ends the script with a sentence that says what failed and one that says what to do.
fail() {
  printf '\n%s: %s\n' "${0##*/}" "$1" >&2
  shift
  for line in "$@"; do printf '  %s\n' "$line" >&2; done
  exit 1
}

package_files=(cmake/packages.txt)
package_list() { sed -e 's/#.*//' -e '/^[[:space:]]*$/d' "${package_files[@]}"; }
missing_packages() {
  local package
  for package in $(package_list); do
    dpkg-query --show --showformat='${db:Status-Status}\n' "$package" 2>/dev/null | grep -qx installed ||
      echo "$package"
  done
}

# Installs what the files in $package_files list and this machine lacks; the only part that needs root.
install_packages() {
  if ! command -v dpkg-query >/dev/null || ! command -v apt-get >/dev/null; then
    fail "this machine has no dpkg-query and apt-get, so packages cannot be installed from here." \
      "Install what your distribution calls these: $(package_list | tr '\n' ' ')" \
      "Then: cmake --preset release && cmake --build build/release"
  fi
  local missing
  missing=$(missing_packages | tr '\n' ' ')
  if [ -z "$missing" ]; then
    say "All packages of ${package_files[*]} are installed."
    return
  fi
  say "To install, once, with apt-get (as root, because it writes to /usr): $missing"
  local root=() by_hand="apt-get update && apt-get install -y $missing"
  if [ "$(id -u)" -ne 0 ]; then
    by_hand="sudo apt-get update && sudo apt-get install -y $missing"
    command -v sudo >/dev/null || fail "installing packages needs root, and there is no sudo here." \
      "As root, run: apt-get update && apt-get install -y $missing" "Then start ${0##*/} again."
    # Without a terminal nobody can type a password: better a clear failure than a wait for ever.
    if [ -t 0 ]; then root=(sudo); else root=(sudo -n); fi
  fi
  local apt=("${root[@]}" env DEBIAN_FRONTEND=noninteractive apt-get -q -o DPkg::Lock::Timeout=300)
  # A source that cannot be reached may not be one that is needed: what counts is whether the install succeeds.
  "${apt[@]}" update </dev/null || say "apt-get update failed; trying with the package lists that are here."
  # shellcheck disable=SC2086  # a list of names
  "${apt[@]}" install -y --no-install-recommends $missing </dev/null ||
    fail "apt-get could not install the packages (its reason is above)." \
      "Is the machine online, and may this user become root? Then by hand: $by_hand" "After that start ${0##*/} again."
  missing=$(missing_packages | tr '\n' ' ')
  [ -z "$missing" ] || fail "apt-get reported success, but these are still not installed: $missing" "By hand: $by_hand"
}

# Every C++ file, for xargs -0.
sources() { find kernels engine tasks io apps python bench tests examples cmake -name '*.[ch]pp' -print0; }

# Prints the clang-format of the release in cmake/python.txt, fails when there is none.
clang_format_version=$(sed -n 's/^clang-format==//p' cmake/python.txt)
clang_format() {
  local program
  for program in build/tools/bin/clang-format clang-format-"${clang_format_version%%.*}" clang-format; do
    command -v "$program" >/dev/null || continue
    # "Debian clang-format version 14.0.6", "clang-format version 14.0.6"
    if "$program" --version | grep -q "version ${clang_format_version//./\\.}"; then
      command -v "$program"
      return
    fi
  done
  return 1
}
# Nothing is built with it, so that a machine without Python or PyPI goes on.
install_tools() {
  if clang_format >/dev/null; then return; fi
  { python3 -m venv build/tools && build/tools/bin/pip install -q -r cmake/python.txt; } </dev/null >/dev/null 2>&1 ||
    say "There is no clang-format $clang_format_version here and PyPI is out of reach: formatting is not checked."
}

# Prints the path of the Python to use. The distribution's comes first, because its packages have PyTorch.
python_program() {
  hash -r  # or type prints only one path of a program that this shell has run
  type -aP python3 | grep -x /usr/bin/python3 || type -P python3
}
# Makes build/venv with what python/requirements.txt lists, and $python_options for the build. Where PyPI is out of
# reach the module is left out.
python_options=(-DTANGERE_PYTHON=OFF)
install_python() {
  local python stamp=build/venv/requirements.txt wanted
  wanted=$(cat python/requirements.txt 2>/dev/null || true)
  python=$(python_program) || python=""
  if [ ! -x build/venv/bin/python ] || [ "$wanted" != "$(cat "$stamp" 2>/dev/null)" ]; then
    if [ -z "$python" ] || ! { "$python" -m venv --clear --system-site-packages build/venv &&
      build/venv/bin/pip install -q --disable-pip-version-check -r python/requirements.txt &&
      printf '%s\n' "$wanted" >"$stamp"; } </dev/null; then
      say "There is no Python with venv and headers here, or PyPI is out of reach:" \
        "the Python module is neither built nor tested."
      return
    fi
  fi
  python_options=(-DTANGERE_PYTHON=ON "-DPython_EXECUTABLE=$PWD/build/venv/bin/python")
}

check_cmake() {
  local version
  version=$(cmake --version | sed -n 's/^cmake version \([0-9]*\.[0-9]*\).*/\1/p')
  [ "$(printf '3.25\n%s\n' "$version" | sort -V | head -n 1)" = 3.25 ] ||
    fail "CMake 3.25 or newer is needed, this machine has $version." \
      "Debian 12, Ubuntu 23.04 and all later ones have it."
}

# One compiler per core, but no more than memory allows: the largest units take 2 GiB each under the sanitizers.
jobs() {
  local cores memory
  cores=$(nproc)
  memory=$(awk '/^MemAvailable:/ { print int($2 / 2097152) }' /proc/meminfo)
  if [ "${memory:-0}" -lt 1 ]; then memory=1; fi
  if [ "$cores" -lt "$memory" ]; then echo "$cores"; else echo "$memory"; fi
}

# build PRESET ISAS [TARGET…]: configures and builds into build/PRESET. ISAS: of the option TANGERE_ISAS. With unity=ON
# it compiles several sources as one (cmake/flags.cmake).
build() {
  local preset=$1 isas=$2
  shift 2
  check_cmake
  cmake --preset "$preset" "-DTANGERE_ISAS=$isas" "-DCMAKE_UNITY_BUILD=${unity:-OFF}" \
    ${cmake_options[@]+"${cmake_options[@]}"} </dev/null ||
    fail "cmake could not configure the build (its reason is above)." \
      "If build/$preset is left from another place or compiler, remove it: rm -r build/$preset"
  cmake --build "build/$preset" --parallel "$(jobs)" ${1:+--target "$@"} </dev/null ||
    fail "the build of build/$preset failed (the compiler's reason is above)." \
      "If the compiler was killed, memory ran out: cmake --build build/$preset --parallel 1"
}
