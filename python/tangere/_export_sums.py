# SPDX-License-Identifier: Apache-2.0
"""What an export says of its files, so that `tangere info` finds those that are missing or cut
short, and `tangere validate` those whose bytes have changed.

    sum of a file     CRC-32 of its name, a zero byte and its bytes
    sum of a folder   that of its files, modulo 2^32

The file that says where the data come from has it as `stored`, four lists of one length: `paths`,
`files` (in a path; 1 of a file), `bytes`, `sums`. Of Zarr a path is the folder of an array, whose
chunks of zeros have no file, and its `.zarray`, by which they are read, is a path of its own. Text
that people edit is left out: README.md, info.json, attributes.
"""

from __future__ import annotations

import zlib
from pathlib import Path
from typing import Iterable

Sums = dict[str, tuple[int, int, int]]  # path → files, bytes, sum

_BLOCK = 1 << 20


def file_sums(folder: Path, names: Iterable[str], folder_keys: bool) -> Sums:
    """Of files below `folder`; those that are not there are left out. `folder_keys`: as folders,
    but for files whose names begin with a dot."""
    found: Sums = {}
    for name in names:
        path = folder / name
        if not path.is_file():
            continue
        key = str(path.parent.relative_to(folder)) if folder_keys and path.name[0] != "." else name
        found = joined([found, {key: (1, path.stat().st_size, _sum(path))}])
    return found


def joined(parts: Iterable[Sums]) -> Sums:
    """Those of several groups of files; folders may occur in many."""
    whole: Sums = {}
    for part in parts:
        for path, (files, size, total) in part.items():
            had = whole.get(path, (0, 0, 0))
            whole[path] = (had[0] + files, had[1] + size, (had[2] + total) % 2**32)
    return whole


def stored(sums: Sums) -> dict[str, list]:
    """As the export has them."""
    paths = sorted(sums)
    files, sizes, totals = ([sums[path][k] for path in paths] for k in range(3))
    return {"paths": paths, "files": files, "bytes": sizes, "sums": totals}


def _sum(path: Path) -> int:
    total = zlib.crc32(path.name.encode() + b"\0")
    with open(path, "rb") as file:
        while block := file.read(_BLOCK):
            total = zlib.crc32(block, total)
    return total
