# SPDX-License-Identifier: Apache-2.0
"""What the tests share: the command of this build, and data sets made once with it."""

from __future__ import annotations

import os
import re
import subprocess
from pathlib import Path

import numpy as np
import pytest

import tangere


@pytest.fixture(scope="session")
def command() -> Path:
    """The program of the build whose module is tested: build/*/tangere beside build/*/python."""
    path = Path(os.environ.get("TANGERE_PROGRAM", Path(tangere.__path__[0]).parents[1] / "tangere"))
    assert path.is_file(), f"no program at {path}; build the target tangere or set TANGERE_PROGRAM"
    return path


@pytest.fixture(scope="session")
def generate(command, tmp_path_factory):
    """generate(task or scene, *options) → the folder of a new data set."""

    def run(what: str, *options: str) -> Path:
        folder = tmp_path_factory.mktemp("data") / "set"
        subprocess.run(
            [command, "generate", what, "--output", folder, *options],
            check=True,
            stdin=subprocess.DEVNULL,
            capture_output=True,
        )
        return folder

    return run


@pytest.fixture
def spoil():
    """Puts a NaN into demo_7 of box pushing, where something is felt, and corrects the checksum."""
    h5py = pytest.importorskip("h5py", reason="h5py is not installed")

    def change(folder: Path) -> None:
        shard = folder / "shard-00000.h5"
        with h5py.File(shard, "r+") as file:
            tactile = file["data/demo_7/obs/tactile"]
            row = int(np.flatnonzero(np.abs(tactile[()]).max((1, 2, 3)))[0])
            tactile[row, 2, 1, 0] = np.nan
        with pytest.raises(tangere.IoError) as error:
            tangere._core.check_shard(shard)
        (found,) = re.findall("numbers is ([0-9a-f]{16}); expected", str(error.value))
        with h5py.File(shard, "r+") as file:
            file.attrs["content_sum"] = np.uint64(int(found, 16))

    return change


@pytest.fixture(scope="session")
def pushes(generate) -> Path:
    """Twenty scripted episodes of box pushing."""
    return generate("box_pushing", "--episodes", "20", "--seed", "5")


@pytest.fixture(scope="session")
def sets(pushes, tmp_path_factory) -> dict[str, Path]:
    """FORMAT → an export of 20 episodes of box pushing, which no test changes."""
    exports = pytest.importorskip("tangere.export")
    folder = tmp_path_factory.mktemp("exports")
    out = {to: folder / f"out.{to}" for to in ("lerobot", "zarr", "ftp1", "univtac", "csv")}
    for to, path in out.items():
        exports.export(pushes, path, to, **({} if to == "csv" else {"workers": 1}))
    return out
