# SPDX-License-Identifier: Apache-2.0
"""How fast the rolling ball is here and in MuJoCo, in turns on one thread.

    build/venv/bin/pip install $(sed -n 's/^#bench //p' python/requirements.txt)
    build/venv/bin/python bench/mujoco_peer.py [--tangere build/release/tangere] [--turns 7]

MuJoCo is the wheel that python/requirements.txt pins. It runs whole episodes in its own C++ loop
(mujoco.rollout), so no time of Python counts beyond one call per 16 episodes. Both engines simulate
a pad that presses a light ball onto the ground and rolls it about, for 1.75 s, with the same
masses, controls, places and pairs that may touch. What a contact is differs: a soft constraint
there, a penalty at 2 168 points here. With a field both compute 20 x 20 points after every step;
MuJoCo's have a depth and two speeds, and no force. CPU time of the process; the least of all turns
counts.
"""

import argparse
import json
import subprocess
import tempfile
import time
from collections.abc import Callable
from pathlib import Path

import mujoco
import numpy as np
from mujoco import rollout

ROOT = Path(__file__).resolve().parent.parent
STEPS, STEP, SIDE = 350, 0.005, 20
BLOCK = 16  # environments that run side by side, as here
# A ball of 34 mg carries 45 mN: with MuJoCo's defaults it would sink half into the ground.
CONTACT = 'solref="0.01 1" solimp="0.9999 0.9999 0.001"'
# Force on the pad until a step, as in the scene [N].
PHASES = [
    (100, (0, 0, 0.2)),
    (150, (0.1, 0, 0.2)),
    (200, (-0.2, 0, 0.2)),
    (250, (0, 0.1, 0.2)),
    (STEPS, (0, -0.2, 0.2)),
]
STATE = mujoco.mjtState.mjSTATE_FULLPHYSICS


def skin() -> str:
    """Returns the points of the pad's lower face as a mesh: vertices, then triangles."""
    places = np.linspace(-0.025, 0.025, SIDE)
    points = " ".join(f"{x:.6f} {y:.6f} -0.005" for x in places for y in places)
    faces = []
    for i in range(SIDE - 1):
        for j in range(SIDE - 1):
            a = i * SIDE + j
            faces += [f"{a} {a + 1} {a + SIDE}", f"{a + 1} {a + SIDE + 1} {a + SIDE}"]
    return f'<mesh name="skin" inertia="shell" vertex="{points}" face="{" ".join(faces)}"/>'


def peer(field: bool) -> mujoco.MjModel:
    axes = {"x": "1 0 0", "y": "0 1 0", "z": "0 0 1"}
    slides = "".join(
        f'<joint name="{name}" type="slide" axis="{axis}" damping="1"/>'
        for name, axis in axes.items()
    )
    motors = "".join(
        f'<motor joint="{name}" ctrlrange="-1 1" ctrllimited="true"/>' for name in axes
    )
    sensor = '<sensor><tactile geom="pad" mesh="skin"/></sensor>' if field else ""
    return mujoco.MjModel.from_xml_string(f"""<mujoco>
  <option timestep="{STEP}" gravity="0 0 -9.8" integrator="implicitfast" cone="elliptic"/>
  <default><geom {CONTACT} contype="0" conaffinity="1"/></default>
  <asset>{skin()}</asset>
  <worldbody>
    <geom type="plane" size="1 1 0.1" friction="0.8"/>
    <body pos="0 0 0.06">{slides}
      <geom name="pad" type="box" size="0.025 0.025 0.005" density="1000" friction="1"/>
    </body>
    <body pos="0 0 0.02"><freejoint/>
      <geom name="ball" type="sphere" size="0.02" density="1" friction="0.8"
            contype="1" conaffinity="0"/>
    </body>
  </worldbody>
  <actuator>{motors}</actuator>{sensor}
</mujoco>""")


class MuJoCo:
    """Episodes of some environments, whose balls start at places of their own."""

    def __init__(self, environments: int, field: bool) -> None:
        self.calls, lanes = max(1, environments // BLOCK), min(environments, BLOCK)
        self.model = peer(field)
        self.data = [mujoco.MjData(self.model)]
        size = mujoco.mj_stateSize(self.model, STATE)
        state = np.empty(size)
        mujoco.mj_getState(self.model, self.data[0], state, STATE)
        self.start = np.tile(state, (lanes, 1))
        # The state is the time, then q: three slides, then the ball's place.
        self.start[:, 4:6] += np.random.default_rng(0).uniform(-3e-3, 3e-3, (lanes, 2))
        steps = np.diff([0] + [end for end, _ in PHASES])
        u = np.repeat([force for _, force in PHASES], steps, axis=0)
        self.controls = np.tile(u, (lanes, 1, 1))
        # What is sampled is written over by the next block, so that memory is not measured.
        self.state = np.empty((lanes, STEPS, size))
        self.felt = np.zeros((lanes, STEPS, self.model.nsensordata)) if field else None

    def run(self) -> float:
        begin = time.process_time()
        for _ in range(self.calls):
            rollout.rollout(
                self.model,
                self.data,
                self.start,
                self.controls,
                state=self.state,
                sensordata=self.felt,
            )
        return time.process_time() - begin

    def check(self) -> str:
        """Says where the first ball ended, and how many points felt it."""
        end = self.state[0, -1]
        text = f"MuJoCo's first ball ends at ({1e3 * end[4]:.1f}, {1e3 * end[5]:.1f}) mm"
        if self.felt is None:
            return text
        touched = int((self.felt[0, STEPS // 2].reshape(3, -1)[0] != 0).sum())
        return f"{text}; {touched} of its points touch in the middle of the run"


class Ours:
    def __init__(self, tangere: Path, scene: Path, environments: int, field: bool) -> None:
        self.command = [str(tangere), "bench", str(scene), "--envs", str(environments)]
        self.command += ["--threads", "1", "--repeat", "1", "--every", "1", "--json"]
        self.command += ["--precision", "double", "--frames", "dense" if field else "none"]

    def run(self) -> float:
        run = subprocess.run(self.command, capture_output=True, text=True, check=True)
        return float(json.loads(run.stdout)["runs"][0]["cpu_seconds"])


def scene_of(folder: Path, name: str, change: Callable[[str], str]) -> Path:
    """Writes the scene with a pad of 20 x 20 points."""
    text = (ROOT / "scenes" / "rolling_ball.xml").read_text()
    path = folder / name
    path.write_text(change(text.replace('resolution="200 200"', f'resolution="{SIDE} {SIDE}"')))
    return path


def longer(text: str) -> str:
    """Returns the scene with the setting that `tangere accuracy` recommends for it."""
    own = 'timestep="5e-3" integrator="BDF2"'
    scene = text.replace(own, 'timestep="12.5e-3" integrator="SDIRK2"')
    assert scene != text
    return scene.replace('every="5"', 'every="2"')


def compare(tangere: Path, scenes: list[Path], environments: int, field: bool, turns: int) -> None:
    there = MuJoCo(environments, field)
    peers: dict[str, MuJoCo | Ours] = {"MuJoCo, 5 ms": there}
    for name, scene in zip(("here, BDF2, 5 ms", "here, SDIRK2, 12.5 ms"), scenes):
        peers[name] = Ours(tangere, scene, environments, field)
    seconds = [[p.run() for p in peers.values()] for _ in range(turns)]
    least = [min(column) for column in zip(*seconds)]
    what = f"{SIDE} x {SIDE} points every step" if field else "no field"
    print(f"\n{environments} environments, {what}\n  {there.check()}")
    for name, best in zip(peers, least):
        rate = STEPS * STEP * environments / best
        print(f"  {name:<22} {rate:10.0f}   {least[0] / best:.2f} x MuJoCo", flush=True)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--tangere", type=Path, default=ROOT / "build" / "release" / "tangere")
    parser.add_argument("--turns", type=int, default=7)
    parser.add_argument("--envs", type=int, nargs="+", default=[1, 1024])
    args = parser.parse_args()
    print(f"MuJoCo {mujoco.__version__}; simulated seconds per CPU second, one thread")
    with tempfile.TemporaryDirectory() as temporary:
        scenes = [
            scene_of(Path(temporary), "plain.xml", lambda text: text),
            scene_of(Path(temporary), "long.xml", longer),
        ]
        for environments in args.envs:
            for field in (False, True):
                compare(args.tangere, scenes, environments, field, args.turns)


if __name__ == "__main__":
    main()
