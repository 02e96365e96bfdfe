# SPDX-License-Identifier: Apache-2.0
"""How fast piles of boxes are here and in MuJoCo, in turns on one thread.

    build/venv/bin/pip install $(sed -n 's/^#bench //p' python/requirements.txt)
    build/venv/bin/python bench/pile_peer.py [--boxes 10 20 50] [--tangere build/release/tangere]

Layers of four boxes fall by 1 to 5 mm onto each other and come to rest. All boxes may touch all
others and the ground, in both engines: here every pair is declared. The start of one box differs
between environments, so lanes do not move alike. A step is 5 ms. What a contact is differs: MuJoCo
solves constraints with some points between each two boxes; here each box has 56 points with
penalties. CPU time of the process; the least of all turns counts.
"""

import argparse
import json
import random
import subprocess
import tempfile
import time
from pathlib import Path

import mujoco
import numpy as np
from mujoco import rollout

STEP, SIDE = 0.005, 0.04
STATE = mujoco.mjtState.mjSTATE_FULLPHYSICS


def places(boxes: int) -> list[tuple[float, float, float]]:
    """Returns where the centres of the boxes are [m]."""
    draw = random.Random(1)
    return [
        (
            0.046 * (i % 2) + draw.uniform(-2.5e-3, 2.5e-3),
            0.046 * (i // 2 % 2) + draw.uniform(-2.5e-3, 2.5e-3),
            0.021 + 0.045 * (i // 4),
        )
        for i in range(boxes)
    ]


def scene(boxes: int) -> str:
    text = [
        '<tangere model="pile">',
        f'<option unit="m-kg" gravity="0 0 -9.8" timestep="{STEP}" integrator="BDF1"/>',
        '<ground pos="0 0 0" normal="0 0 1"/>',
        '<default><body density="600"/>',
        '<ground_contact kn="5e3" kt="5" mu="0.6" damping="100"/>',
        '<general_primitive_contact kn="5e3" kt="5" mu="0.6" damping="1e3"/></default>',
    ]
    for i, (x, y, z) in enumerate(places(boxes)):
        text.append(
            f'<robot><link name="b{i}">'
            f'<joint name="b{i}" type="free3d" pos="{x:.5f} {y:.5f} {z:.5f}"/>'
            f'<body name="b{i}" type="cuboid" size="{SIDE} {SIDE} {SIDE}" '
            'general_contact_resolution="4 4 4"/></link></robot>'
        )
    text.append("<contact>")
    text += [f'<ground_contact body="b{i}"/>' for i in range(boxes)]
    text += [
        f'<general_primitive_contact general_body="b{i}" primitive_body="b{k}"/>'
        for i in range(boxes)
        for k in range(boxes)
        if i != k
    ]
    text.append('</contact><randomize><joint name="b0" q="2" uniform="0 0.003"/></randomize>')
    return "\n".join([*text, "</tangere>"])


class MuJoCo:
    def __init__(self, boxes: int, steps: int) -> None:
        self.steps = steps
        bodies = "".join(
            f'<body pos="{x:.5f} {y:.5f} {z:.5f}"><freejoint/><geom type="box" density="600" '
            f'size="{SIDE / 2} {SIDE / 2} {SIDE / 2}" friction="0.6"/></body>'
            for x, y, z in places(boxes)
        )
        self.model = mujoco.MjModel.from_xml_string(
            f'<mujoco><option timestep="{STEP}" gravity="0 0 -9.8" integrator="implicitfast"/>'
            '<worldbody><geom type="plane" size="5 5 0.1" friction="0.6"/>'
            f"{bodies}</worldbody></mujoco>"
        )
        self.data = mujoco.MjData(self.model)
        self.start = np.empty((1, mujoco.mj_stateSize(self.model, STATE)))
        mujoco.mj_getState(self.model, self.data, self.start[0], STATE)

    def run(self) -> float:
        begin = time.process_time()
        self.state, _ = rollout.rollout(self.model, self.data, self.start, nstep=self.steps)
        return (time.process_time() - begin) / self.steps


def ours(tangere: Path, path: Path, environments: int, steps: int) -> tuple[float, float]:
    """Returns the CPU seconds of a step of an environment, and its Newton evaluations."""
    command = [str(tangere), "bench", str(path), "--envs", str(environments), "--json"]
    command += ["--steps", str(steps), "--threads", "1", "--repeat", "1", "--frames", "none"]
    out = json.loads(subprocess.run(command, capture_output=True, text=True, check=True).stdout)
    run = out["runs"][0]
    return run["cpu_seconds"] / (environments * steps), run["newton_iterations"]


def main() -> None:
    options = argparse.ArgumentParser(description=__doc__.split("\n\n")[0])
    options.add_argument("--boxes", type=int, nargs="+", default=[10, 20, 50])
    options.add_argument("--steps", type=int, default=400)
    options.add_argument("--envs", type=int, default=16)
    options.add_argument("--turns", type=int, default=5)
    options.add_argument("--tangere", type=Path, default=Path("build/release/tangere"))
    given = options.parse_args()
    print(f"{given.steps} steps of {STEP} s; microseconds of a CPU for a step of an environment\n")
    print(f"boxes  MuJoCo  alone  ratio  {given.envs} environments  ratio  evaluations a step")
    with tempfile.TemporaryDirectory() as folder:
        for boxes in given.boxes:
            path = Path(folder) / "pile.xml"
            path.write_text(scene(boxes))
            peer = MuJoCo(boxes, given.steps)
            theirs, alone, group, newton = [], [], [], 0.0
            for _ in range(given.turns):
                theirs.append(peer.run())
                seconds, newton = ours(given.tangere, path, 1, given.steps)
                alone.append(seconds)
                group.append(ours(given.tangere, path, given.envs, given.steps)[0])
            a, b, c = (1e6 * min(times) for times in (theirs, alone, group))
            print(
                f"{boxes:5d}  {a:6.1f}  {b:5.1f}  {b / a:5.2f}  {c:{len(str(given.envs)) + 13}.1f}"
                f"  {c / a:5.2f}  {newton:.2f}"
            )


if __name__ == "__main__":
    main()
