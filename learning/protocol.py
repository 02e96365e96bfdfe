# SPDX-License-Identifier: Apache-2.0
"""How every learner here is tested, so that their figures can be compared.

Training, choice of the best policy of a run, and test use different seeds of the environment. The
test episodes are the same for every policy. A result is one JSON object a run (`--json`).

    rate of successes: Wilson's interval          (p + z²/2n ± z √(p(1-p)/n + z²/4n²)) / (1 + z²/n)
    mean of k runs:    Student's interval         x̄ ± t_{0.975, k-1} s / √k
"""

from __future__ import annotations

import argparse
import importlib
import platform
import sys
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Callable, Sequence

import numpy as np
import torch

import tangere

TEST_SEED = 3000017  # of the episodes that policies are tested on; no setting was compared in them
EARLIER_TEST_SEED = 1000003  # of results without "test_seed"; some settings were compared in them
CHOICE_SEED = 2000003  # of those by which the best policy of a run is chosen
CHOICE_EPISODES = 300
PLACE_UNIT, YAW_UNIT = 0.1, 0.276  # [m], [rad]: what costs 1 in the reward of box pushing

# t_{0.975, k-1} for k = 2 … 10 runs, from a table of Student's distribution.
_STUDENT = (12.706, 4.303, 3.182, 2.776, 2.571, 2.447, 2.365, 2.306, 2.262)

Env = tangere.gym.VectorTaskEnv | tangere.VectorSceneEnv
Choose = Callable[[Env, Any, int], np.ndarray]


def add_choice(parser: argparse.ArgumentParser) -> None:
    """`--choice`: settings are compared in other episodes than those of the test."""
    parser.add_argument(
        "--choice", dest="play_seed", action="store_const", const=CHOICE_SEED, default=TEST_SEED,
        help="play the episodes by which settings are chosen, not those of the test",
    )  # fmt: skip


def make_vec(task: str, num_envs: int, **options: Any) -> Env:
    """Environments of a task: a name of the catalogue, or FILE.py:CLASS or MODULE:CLASS of a
    `tangere.VectorSceneEnv`. Ends the program if there is none."""
    if task in tangere.task_names():
        return tangere.make_vec(task, num_envs, **options)
    where, _, name = task.rpartition(":")
    if not where or not name:
        raise SystemExit(
            f"task {task!r}; expected one of {', '.join(tangere.task_names())}, or FILE.py:CLASS "
            "or MODULE:CLASS of a tangere.VectorSceneEnv"
        )
    module = where
    if where.endswith(".py"):
        if not Path(where).is_file():
            raise SystemExit(f"task {task!r}; there is no file {where}")
        sys.path.insert(0, str(Path(where).parent.resolve()))
        module = Path(where).stem
    kinds = {
        key: kind for key, kind in vars(importlib.import_module(module)).items()
        if isinstance(kind, type) and issubclass(kind, tangere.VectorSceneEnv)
    }  # fmt: skip
    if name not in kinds:
        raise SystemExit(
            f"task {task!r}; {where} has {list(kinds)} of tangere.VectorSceneEnv, not {name!r}"
        )
    return kinds[name](num_envs, **options)


@dataclass
class Played:
    """What E episodes came to; each (E)."""

    solved: np.ndarray  #: bool
    returns: np.ndarray  #: sums of rewards
    actions: np.ndarray  #: how many were taken
    position: np.ndarray | None = None  #: box pushing: distance from the goal at the end [m]
    yaw: np.ndarray | None = None  #: box pushing: angle from the goal at the end [rad]

    def summary(self) -> dict[str, float]:
        """Means. `actions_solved` is that of the solved episodes alone, NaN-free."""
        means = {
            "episodes": len(self.solved),
            "success": float(self.solved.mean()),
            "return": float(self.returns.mean()),
            "actions_solved": float(self.actions[self.solved].mean()) if self.solved.any() else 0.0,
        }
        if self.position is not None:
            means |= {"position_m": float(self.position.mean()), "yaw_rad": float(self.yaw.mean())}
        return means


def play(env: Env, seed: int, choose: Choose, first_episode: int = 0) -> Played:
    """Plays episodes of a seed to their ends. `env` has autoreset="disabled".

    `choose(env, obs, t)` returns action t of every environment, (E, na).
    """
    obs, _ = env.reset(seed=seed, options={"first_episode": first_episode})
    over = np.zeros(env.num_envs, bool)
    solved = np.zeros(env.num_envs, bool)
    returns = np.zeros(env.num_envs)
    actions = np.zeros(env.num_envs, int)
    for t in range(horizon(env)):
        obs, reward, terminated, truncated, info = env.step(choose(env, obs, t))
        returns += np.where(over, 0, reward)
        actions += ~over
        solved |= ~over & info["success"]
        over |= terminated | truncated
        if over.all():
            break
    is_box = hasattr(env, "task") and env.task.name.startswith("box_pushing")
    position, yaw = box_errors(env) if is_box else (None, None)
    return Played(solved, returns, actions, position, yaw)


def horizon(env: Env) -> int:
    """Actions after which an episode is truncated."""
    return env.task.horizon if hasattr(env, "task") else env.horizon


def merit(played: dict[str, float]) -> tuple[float, ...]:
    """By which the best policy of a run is chosen, from a summary; the larger one is better.

    It is the rate of successes, and between equal rates the mean return: a few lost episodes decide
    a mean of rewards that are quadratic in the error, and more so if episodes go on until they are
    solved. In box pushing it is minus the mean errors, in the reward's proportion.
    """
    if "position_m" not in played:
        return played["success"], played["return"]
    return (-(played["position_m"] / PLACE_UNIT + played["yaw_rad"] / YAW_UNIT),)


def box_errors(env: tangere.gym.VectorTaskEnv) -> tuple[np.ndarray, np.ndarray]:
    """Box pushing: distance [m] and angle [rad] between box and goal, each (E)."""
    q, _, memory = env.state()
    names = env.model.q_names
    x, y, yaw = (names.index(n) for n in ("box_slide.x", "box_slide.y", "box_turn.angle"))
    start = tangere.Batch(env.model)
    box = start.bodies()[0][0, env.model.body_names.index("box"), :2]  # [m], in the world
    off = q[:, [x, y]] + (box - start.q[0, [x, y]]) - memory[:, :2]
    return np.hypot(*off.T), np.abs(q[:, yaw] - memory[:, 2])


def wilson(rate: float, n: int) -> tuple[float, float]:
    """Wilson's 95 % interval of a rate of successes among n episodes."""
    z = 1.96
    middle, half = rate + z * z / (2 * n), z * np.sqrt(rate * (1 - rate) / n + z * z / (4 * n * n))
    scale = 1 + z * z / n
    return float((middle - half) / scale), float((middle + half) / scale)


def student(values: Sequence[float]) -> float:
    """Half of Student's 95 % interval of the mean of 2 to 10 runs."""
    if not 2 <= len(values) <= len(_STUDENT) + 1:
        raise ValueError(f"{len(values)} runs; expected 2 to {len(_STUDENT) + 1}")
    return float(_STUDENT[len(values) - 2] * np.std(values, ddof=1) / np.sqrt(len(values)))


def provenance(device: str = "cpu") -> dict[str, str | int]:
    """The version, the machine and the seed of the test episodes of a result.

    `device`: where PyTorch's networks were.
    """
    cpu = platform.machine()
    info = Path("/proc/cpuinfo")
    if info.exists():
        models = [line for line in info.read_text().splitlines() if line.startswith("model name")]
        cpu = models[0].split(":", 1)[1].strip() if models else cpu
    said = {"version": tangere.__version__, "machine": cpu, "test_seed": TEST_SEED,
            "instruction_set": tangere._core.instruction_set}  # fmt: skip
    return said | ({"device": torch.cuda.get_device_name(device)} if device != "cpu" else {})


def source(merged: Path) -> dict[str, str]:
    """Which data set a policy learned from: what its robomimic.hdf5 says of itself."""
    import h5py  # of those who learn from data sets alone

    with h5py.File(merged, "r") as file:
        return {name: str(file.attrs[name]) for name in ("command", "content_sum")}
