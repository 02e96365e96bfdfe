# SPDX-License-Identifier: Apache-2.0
"""Checks an installed wheel, for ./dev wheel: every instruction set, the command, a data set.

    python cmake/wheel_check.py          # needs h5py besides
    python cmake/wheel_check.py bits     # one instruction set, no data set: also for a build

Prints the digest of states and fields of each instruction set that the processor has.
"""

from __future__ import annotations

import hashlib
import os
import subprocess
import sys
import tempfile
from pathlib import Path

NEEDED = {"scalar": (), "sse2": ("sse2",), "avx2": ("avx2", "fma")}
NEEDED["avx512"] = ("avx512f", "avx512cd", "avx512dq", "avx512bw")
SYSTEM = {"libc", "libm", "libdl", "librt", "libpthread", "libz", "libstdc++", "libgcc_s"}


def bits() -> str:
    """The instruction set and the digest of what a batch reads under it."""
    import tangere

    batch = tangere.Batch(tangere.Model(tangere.Scene(tangere.scenes()["rolling_ball_small"])), 20)
    run = batch.run(batch.scene_controls(200), every=20, fields=["pad"])
    assert abs(run.fields["pad"]).max() > 1e-4, "the ball does not touch the pad"  # [N]
    digest = hashlib.sha256(run.q.tobytes() + run.v.tobytes() + run.fields["pad"].tobytes())
    return f"{tangere.instruction_set} {digest.hexdigest()[:16]}"


def check_sets() -> None:
    flags = set(Path("/proc/cpuinfo").read_text().split())
    for name, needed in NEEDED.items():
        if not flags.issuperset(needed):
            print(f"{name}: not on this processor")
            continue
        words = [sys.executable, __file__, "bits"]
        line = subprocess.check_output(words, env=os.environ | {"TANGERE_ISA": name}, text=True)
        assert line.startswith(f"{name} "), f"'{line}' under TANGERE_ISA={name}"
        print(line, end="")


def check_files(folder: Path) -> None:
    """The command writes data sets, alone and with a function of this process as policy."""
    import h5py
    import tangere.data

    words = ["tangere", "generate", "box_pushing", "--episodes", "4", "--output", folder / "a"]
    subprocess.run([*words, "--compress", "deflate"], check=True, capture_output=True)
    with h5py.File(folder / "a" / "shard-00000.h5") as file:
        field = file["data/demo_0/obs/tactile"][()]
    assert field.shape[1:] == (13, 10, 3) and abs(field).max() > 0, field.shape

    def still(observations, *_):
        return [[0.0, 0.0, 0.0]] * len(observations["tactile"])

    tangere.data.generate("box_pushing", folder / "b", 2, policy=still, name="still")
    subprocess.run(["tangere", "validate", folder / "b"], check=True, capture_output=True)
    check_own_task(folder / "c")


def check_own_task(folder: Path) -> None:
    """The module itself writes and reads data sets."""
    import tangere.data

    class Press(tangere.VectorSceneEnv):
        scene, horizon = tangere.scenes()["rolling_ball_small"], 3

        def reward(self, actions):
            return -(actions**2).sum(1)

    tangere.data.generate(Press, folder, 2, policy="random")
    subprocess.run(["tangere", "validate", folder], check=True, capture_output=True)
    assert "episode 1" in tangere.view(folder).html


def check_libraries() -> None:
    """Nothing but the system's common libraries is used from outside of the environment."""
    import tangere

    package = Path(tangere.__path__[0])
    loader = next(Path("/lib64").glob("ld-linux*"))
    for file in [*package.glob("_core*.so"), package / "bin" / "tangere"]:
        listed = subprocess.check_output([loader, "--list", file], text=True)
        for line in listed.splitlines():
            name, arrow, path = line.partition(" => ")
            inside = path.startswith(str(package.parent))
            assert not arrow or inside or name.strip().split(".so")[0] in SYSTEM, f"{file}: {line}"


if __name__ == "__main__":
    if sys.argv[1:] == ["bits"]:
        print(bits())
    else:
        check_libraries()
        check_sets()
        with tempfile.TemporaryDirectory() as temporary:
            check_files(Path(temporary))
