# shellcheck shell=bash
# SPDX-License-Identifier: Apache-2.0
# ./dev wheel: one file for Python 3.10 and later that needs no library of the distribution, and its test. Sourced.

wheels=$PWD/build/wheels

# make_wheel PYTHON: leaves the wheel in build/wheels. auditwheel puts the libraries into it.
make_wheel() {
  local tools=$wheels/tools
  rm -rf "$wheels"
  "$1" -m venv "$tools"
  # shellcheck disable=SC2046  # a list of names
  "$tools/bin/pip" install -q $(sed -n 's/^#wheel //p' cmake/python.txt) ||
    fail "the tools that cmake/python.txt lists for wheels could not be installed (the reason is above)."
  "$tools/bin/pip" wheel -q --no-deps -w "$wheels/raw" . </dev/null || fail "the wheel could not be built (see above)."
  PATH="$tools/bin:$PATH" auditwheel repair -w "$wheels" "$wheels"/raw/*.whl ||
    fail "auditwheel could not put the libraries into the wheel (its reason is above)."
}

# bare PYTHON WORD…: runs PYTHON where the folder of the distribution's libraries has only those that every Linux with
# glibc has (the policy of manylinux) and those that this Python needs.
bare() {
  local python=$1 system kept
  system=/usr/lib/$(uname -m)-linux-gnu
  kept=$(mktemp -d)
  "$python" -c 'import sys, sysconfig, glob
print(sys.executable, *glob.glob(sysconfig.get_config_var("DESTSHARED") + "/*.so"), sep="\n")' |
    xargs ldd 2>/dev/null | sed -n 's/.*=> \(.*\) (0x.*/\1/p' | sort -u | xargs cp -Lt "$kept"
  cp -Lt "$kept" "$system"/ld-linux*.so.* "$system"/lib{c,m,dl,rt,pthread,z,stdc++,gcc_s}.so.[0-9]
  # Mounts of a name space of its own: nobody else sees them, and they end with the program.
  unshare --map-root-user --mount sh -c 'mount --bind "$0" "$1" && shift && exec env -i "PATH=${1%/*}:$PATH" "$@"' \
    "$kept" "$system" "$@"
  local status=$?
  rm -rf "$kept"
  return "$status"
}

# check_wheel PYTHON: installs the wheel into an environment of its own and runs cmake/wheel_check.py there.
check_wheel() {
  local venv
  venv=$wheels/venv-$("$1" -c 'import sys; print("%d.%d" % sys.version_info[:2])')
  { "$1" -m venv --clear "$venv" && "$venv/bin/pip" install -q --only-binary :all: h5py "$wheels"/*.whl; } ||
    fail "the wheel could not be installed with $1 (the reason is above)."
  bare "$venv/bin/python" cmake/wheel_check.py >"$venv/bits" || fail "the wheel fails with $1 (the reason is above)."
  say "$("$venv/bin/python" --version): passed"
}

# same_bits FILE: compares the digests in FILE with those of build/release, for the instruction sets that it has.
same_bits() {
  local name digest line
  if [ ! -e build/release/python/tangere/scene_elements.py ]; then
    say "Not compared with build/release, where there is no Python module (./run-demo --python)."
    return
  fi
  while read -r name digest; do
    line=$(TANGERE_ISA=$name PYTHONPATH=build/release/python build/venv/bin/python cmake/wheel_check.py bits \
      2>/dev/null) || continue
    [ "$line" = "$name $digest" ] || fail "the wheel has other bits than build/release: $name $digest, there $line."
    say "$name: the bits of build/release"
  done < <(grep -v : "$1")
}

# wheel [PYTHON…]: the first one builds it; all of them test it.
wheel() {
  local begin=$SECONDS python file
  if [ $# -eq 0 ]; then set -- "$(python_program)"; fi
  make_wheel "$1"
  file=$(echo "$wheels"/*.whl)
  say "Built in $((SECONDS - begin)) s: $file, $(du -h "$file" | cut -f 1)"
  for python in "$@"; do check_wheel "$python"; done
  set -- "$wheels"/venv-*/bits
  for file in "$@"; do cmp "$1" "$file" || fail "the wheel has other bits in ${file%/bits} than in ${1%/bits}."; done
  cat "$1"
  same_bits "$1"
}
