#!/usr/bin/env bash
# SPDX-License-Identifier: Apache-2.0
# No function of the kernels may stand in the objects of two instruction sets: the linker keeps one
# copy for all, and a machine without AVX-512 would meet the AVX-512 one. Nor may the number of
# tactile kernels grow unnoticed. Takes the kernels' library.
set -euo pipefail
library=$1
command -v nm >/dev/null || { echo "nm is not there: skipped"; exit 77; }
# kernels.avx2.steps.cpp.o → avx2
shared=$(nm -C "$library" | awk '
  /^kernels\..*:$/ { split($1, parts, "."); isa = parts[2]; next }
  /^[^ ].*:$/ { isa = ""; next }
  isa != "" && $2 == "W" { sub(/^[0-9a-f]+ W /, ""); if (!((isa, $0) in seen)) { seen[isa, $0] = 1; count[$0]++ } }
  END { for (name in count) if (count[name] > 1) print name }')
isas=$(nm "$library" 2>/dev/null | sed -n 's/^kernels\.\([^.]*\)\..*:$/\1/p' | sort -u | tr '\n' ' ')
[ -n "$isas" ] || { echo "no objects of kernels in $library"; exit 1; }
# GCC 12 makes these of sums of products with alternating signs, whatever -ffp-contract says: other bits.
if command -v objdump >/dev/null && objdump -d "$library" | grep -qE 'vfm(addsub|subadd)'; then
  echo "an instruction that fuses what the source does not: vfmaddsub or vfmsubadd"
  exit 1
fi
# Seven shapes, two laws, two precisions, flat and curved pads, whole fields and pressure alone.
# Another choice of two doubles the compile time and the size of the library: weigh it, then change
# the number.
for kernel in chunk_force:112 tile_lanes:56; do
  most=$(nm -C "$library" | awk -v name=" ${kernel%:*}<" '
    /^kernels\..*:$/ { split($1, parts, "."); isa = parts[2] }
    { sub(/tangere::kernels::/, "") }
    index($0, name) { ++count[isa] }
    END { for (isa in count) if (count[isa] > most) most = count[isa]; print most + 0 }')
  if [ "$most" -lt 1 ] || [ "$most" -gt "${kernel#*:}" ]; then
    echo "$most instances of ${kernel%:*} for an instruction set; expected 1 to ${kernel#*:}"
    exit 1
  fi
done
if [ -n "$shared" ]; then
  echo "in the objects of more than one instruction set:"
  echo "$shared"
  exit 1
fi
echo "share no function: $isas"
