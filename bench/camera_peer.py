# SPDX-License-Identifier: Apache-2.0
"""How far silhouettes of a camera are from MuJoCo's, of a mesh and of shapes, in random poses.

    build/venv/bin/pip install $(sed -n 's/^#bench //p' python/requirements.txt)
    PYTHONPATH=build/release/python build/venv/bin/python bench/camera_peer.py [--poses 50]

Both draw the same body before the same camera; MuJoCo by OpenGL (MUJOCO_GL=egl, or osmesa). A pixel
belongs to the body where the number of the nearest body says so: `eye.ids` here, segmentation
there. A pixel that only one has is off by its distance to the other's silhouette [pixels, the
larger of both axes].
"""

import argparse
import os
from pathlib import Path

os.environ.setdefault("MUJOCO_GL", "egl")
import mujoco  # noqa: E402
import numpy as np  # noqa: E402

import tangere  # noqa: E402

MUG = Path(__file__).parents[1] / "scenes/meshes/mug.obj"
EYE, LOOK, FOV, ROWS, COLS = np.array([0.05, -0.4, 0.2]), np.array([0, 0, 0.0]), 40, 240, 320
SHAPES = {  # name: (attributes here, attributes there)
    "mesh": (f'type="mesh" filename="{MUG}" transform_type="OBJ_TO_JOINT"', 'type="mesh" mesh="m"'),
    "ball": ('type="sphere" radius="0.05"', 'type="sphere" size="0.05"'),
    "box": ('type="cuboid" size="0.1 0.06 0.04"', 'type="box" size="0.05 0.03 0.02"'),
    "capsule": ('type="capsule" radius="0.03" length="0.1"', 'type="capsule" size="0.03 0.05"'),
    "cylinder": ('type="cylinder" radius="0.03" length="0.1"', 'type="cylinder" size="0.03 0.05"'),
    "ellipsoid": (
        'type="ellipsoid" size="0.1 0.06 0.04"',
        'type="ellipsoid" size="0.05 0.03 0.02"',
    ),
}


def camera_axes() -> str:
    """The camera's x and y axes, the numbers of MuJoCo's xyaxes."""
    ahead = (LOOK - EYE) / np.linalg.norm(LOOK - EYE)
    x = np.cross(ahead, [0, 0, 1.0])
    x /= np.linalg.norm(x)
    return " ".join(f"{n:.17g}" for n in [*x, *np.cross(x, ahead)])


def words(numbers) -> str:
    return " ".join(f"{n:.17g}" for n in numbers)


class Here:
    def __init__(self, shape: str):
        text = f"""<tangere model="eye"><option unit="m-kg" gravity="0 0 0" timestep="1e-3"/>
<robot><link name="body"><joint name="body" type="free3d"/><body name="body" {shape} density="700"/>
</link></robot><sensor><camera name="eye" pos="{words(EYE)}" look="{words(LOOK)}" fov="{FOV}"
rows="{ROWS}" cols="{COLS}"/></sensor></tangere>"""
        self.batch = tangere.Batch(tangere.Model(tangere.Scene.from_string(text)), num_envs=1)

    def silhouette(self, place, turn) -> np.ndarray:
        q = self.batch.q
        q[0] = [*place, *turn]
        self.batch.set_state(q, np.zeros((1, 6)))
        ids = np.asarray(self.batch.tactile("eye.ids"))[0].reshape(ROWS, COLS)
        return ids >= 0


class There:
    def __init__(self, shape: str):
        self.model = mujoco.MjModel.from_xml_string(f"""<mujoco><asset><mesh name="m" file="{MUG}"
        inertia="exact"/></asset><visual><map znear="0.01"/></visual><worldbody>
        <camera name="eye" pos="{words(EYE)}" xyaxes="{camera_axes()}" fovy="{FOV}"/>
        <body name="body"><freejoint/><geom {shape}/></body></worldbody></mujoco>""")
        self.data = mujoco.MjData(self.model)
        self.renderer = mujoco.Renderer(self.model, ROWS, COLS)
        self.renderer.enable_segmentation_rendering()

    def silhouette(self, place, turn) -> np.ndarray:
        self.data.qpos[:] = [*place, *turn]
        mujoco.mj_forward(self.model, self.data)
        self.renderer.update_scene(self.data, camera="eye")
        return self.renderer.render()[..., 0] >= 0


def grown(mask: np.ndarray) -> np.ndarray:
    """The mask and all pixels beside it, also at corners."""
    padded = np.pad(mask, 1)
    rows, cols = mask.shape
    return np.any([padded[i : i + rows, j : j + cols] for i in range(3) for j in range(3)], axis=0)


def distance(one: np.ndarray, other: np.ndarray) -> int:
    """Of the pixels that only one mask has to the other mask, the largest [pixels]."""
    most = 0
    for mask, beside in ((one, other), (other, one)):
        steps, near = 0, beside
        while (mask & ~near).any():
            steps, near = steps + 1, grown(near)
        most = max(most, steps)
    return most


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--poses", type=int, default=50)
    poses = parser.parse_args().poses
    print(f"MuJoCo {mujoco.__version__}, {poses} poses, {COLS} x {ROWS} pixels")
    for name, (here, there) in SHAPES.items():
        draw = np.random.default_rng(1)
        ours, theirs = Here(here), There(there)
        most = differing = pixels = 0
        for _ in range(poses):
            place, turn = draw.uniform(-0.03, 0.03, 3), draw.normal(size=4)
            turn /= np.linalg.norm(turn)
            a, b = ours.silhouette(place, turn), theirs.silhouette(place, turn)
            assert a.any() and b.any(), name
            most = max(most, distance(a, b))
            differing, pixels = differing + int((a != b).sum()), pixels + int(a.sum())
        print(f"{name:10s} at most {most} pixels off; {differing} of {pixels} pixels differ")


if __name__ == "__main__":
    main()
