# SPDX-License-Identifier: Apache-2.0
"""Tangere simulates what tactile skins feel: thousands of environments at once, on CPUs.

    model = tangere.Model(tangere.Scene(tangere.scenes()["rolling_ball"]))
    batch = tangere.Batch(model, num_envs=256)
    batch.step([0.0, 0.0, -0.5])
    batch.tactile("pad")                    # (256, 200, 200, 3) float32 [N]

    env = tangere.make_vec("box_pushing", num_envs=256)      # Gymnasium's vector interface

`tangere.scene_builder` builds scenes without files, `tangere.robots` makes them of robots.
`tangere.gym` has the environments, `tangere.scene_env` those of a task written in Python,
`tangere.torch` and `tangere.jax` gradients through PyTorch and JAX, `tangere.data` data sets for
learning, `tangere.policy` policies that the command calls. `tangere.lerobot`, `tangere.robomimic`,
`tangere.d3rlpy` and `tangere.sb3` connect to the libraries of these names. All but
`tangere.scene_builder`, `tangere.robots`, `tangere.gym`, `tangere.scene_env` and `tangere.policy`
need packages that `import tangere` does not import.
"""

from __future__ import annotations

from pathlib import Path

from . import _core
from ._core import (
    Batch,
    Camera,
    Environments,
    InputError,
    IoError,
    Model,
    Run,
    Scene,
    Sensor,
    StepStatus,
    TaskSpec,
    TaskTape,
    TensorSpec,
    instruction_set,
    task_names,
    task_spec,
)
from ._rollout import rollout
from ._view import Page, view
from .gym import TaskEnv, VectorTaskEnv, gym_id, make_env, make_vec, register_tasks
from .robots import import_robot
from .scene_builder import SceneBuilder
from .scene_env import SceneEnv, VectorSceneEnv, register_scene_env

__all__ = [
    "Batch",
    "Camera",
    "Environments",
    "InputError",
    "IoError",
    "Model",
    "Page",
    "Run",
    "Scene",
    "SceneBuilder",
    "SceneEnv",
    "Sensor",
    "StepStatus",
    "TaskEnv",
    "TaskSpec",
    "TaskTape",
    "TensorSpec",
    "VectorSceneEnv",
    "VectorTaskEnv",
    "__version__",
    "gym_id",
    "import_robot",
    "instruction_set",
    "make_env",
    "make_vec",
    "register_scene_env",
    "rollout",
    "scenes",
    "task_names",
    "task_spec",
    "view",
]

__version__: str = getattr(_core, "__version__")  # stubs leave such names out


def scenes() -> dict[str, Path]:
    """The scenes that come with the package: name without .xml → path of the file."""
    return {path.stem: path for path in sorted((Path(__file__).parent / "scenes").glob("*.xml"))}


register_tasks()
