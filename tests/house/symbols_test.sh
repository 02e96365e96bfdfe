#!/usr/bin/env bash
# SPDX-License-Identifier: Apache-2.0
# No function of the kernels may stand in the objects of two instruction sets: the linker keeps one
# copy for all, and a machine without AVX-512 would meet the AVX-512 one. Nor may the number of
# variants of the innermost kernels grow unnoticed. Nor may a table be filled before main(): that
# would run on machines without its instruction set. Takes the kernels' library.
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
if nm "$library" | grep -q '_GLOBAL__sub_I'; then
  echo "static initialisers in $library, which run on machines without their instruction set"
  exit 1
fi
# GCC 12 makes these of sums of products with alternating signs, whatever -ffp-contract says: other bits.
if command -v objdump >/dev/null && objdump -d "$library" | grep -qE 'vfm(addsub|subadd)'; then
  echo "an instruction that fuses what the source does not: vfmaddsub or vfmsubadd"
  exit 1
fi
# Innermost kernels, and how often the compiler may make each for an instruction set. Another choice
# of two doubles the compile time and the size of the library: weigh it, then change the number.
kernels='
  chunk_force:112 tile_lanes:56             fields: seven shapes, two laws, two precisions, flat and
                                            curved pads, whole fields and pressure alone
  sum_link_pair:4 sum_grounded:4            steps: a group or one environment, with derivatives or not
  add_chunk:34 add_sphere:8                 contacts: the same for balls, for flat and bent faces,
  add_elastic:12 accumulate_elastic:12      and for other shapes, with memory of friction and without
  add_load_entries:8
  pair_adjoint:18 pull_back_motion:18       reverse: the same for what a gradient needs, and for
                                            spheres that touch with their surface
  parameter_products:4'
names=$(nm -C --defined-only "$library" | sed -E 's/tangere::kernels:://g; /\{lambda|\[clone/d')
for kernel in $(grep -oE '[a-z_]+:[0-9]+' <<< "$kernels"); do
  most=$(awk -v name=" ${kernel%:*}<" '
    /^kernels\..*:$/ { split($1, parts, "."); isa = parts[2] }
    index($0, name) { sub(/^[0-9a-f]+ . /, ""); count[isa] += seen[isa, $0]++ == 0 }
    END { for (isa in count) if (count[isa] > most) most = count[isa]; print most + 0 }' <<< "$names")
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
