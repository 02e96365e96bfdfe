# SPDX-License-Identifier: Apache-2.0
"""Policies of lerobot in closed loop: observations of a task become the features of an export."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any, Callable, Protocol

import numpy as np

from . import _core, gym, scene_env
from ._closed_loop import TEST_SEED, play_episodes
from ._lerobot_features import Feature

Frames = dict[str, np.ndarray]


class FramePolicy(Protocol):
    """A policy of many environments. One with memory has a method `reset`, called at a start."""

    def __call__(self, frames: Frames) -> Any:
        """Takes features by name, (E, …), pictures as (E, height, width, 3) uint8.

        Returns actions (E, na), an array or a tensor.
        """


class Checkpoint:
    """A policy that lerobot has trained, as `play` takes it. Needs lerobot.

    folder: with config.json and weights, such as outputs/…/checkpoints/last/pretrained_model.
    text: of the task, for policies that read one.

    Raises InputError if lerobot cannot load the folder.
    """

    def __init__(self, folder: str | Path, text: str = ""):
        from lerobot.configs.policies import PreTrainedConfig
        from lerobot.policies.factory import get_policy_class, make_pre_post_processors

        try:
            config = PreTrainedConfig.from_pretrained(folder)
            self._policy = get_policy_class(config.type).from_pretrained(folder, config=config)
            self._before, self._after = make_pre_post_processors(config, str(folder))
        except Exception as error:  # whatever reading a configuration and weights may meet
            raise _core.InputError(
                f"{folder}: {error!r}; expected a checkpoint of lerobot, as its save_pretrained "
                "writes it"
            ) from error
        self._text = text
        self.reset()

    def reset(self) -> None:
        """Forgets the actions and observations of earlier episodes."""
        self._policy.reset()

    def __call__(self, frames: Frames) -> Any:
        """Actions (E, na) for features by name, (E, …)."""
        import torch

        wanted: dict[str, Any] = {}
        for name in self._policy.config.input_features:
            if name not in frames:
                raise _core.InputError(
                    f"the policy reads {name!r}; the data set has {sorted(frames)}"
                )
            rows = torch.from_numpy(frames[name])
            wanted[name] = rows.movedim(-1, 1) / 255 if rows.dtype == torch.uint8 else rows
        wanted["task"] = [self._text] * len(rows)
        with torch.inference_mode():
            return self._after(self._policy.select_action(self._before(wanted))).cpu()


def play(
    policy: FramePolicy | str | Path,
    data: str | Path,
    episodes: int = 300,
    *,
    task: str | type[scene_env.VectorSceneEnv] | None = None,
    seed: int = TEST_SEED,
    num_envs: int = 64,
    threads: int | None = None,
) -> dict[str, Any]:
    """Plays fresh episodes of a task by a policy that was trained with an export of it.

    Parameters
    ----------
    policy: a folder that lerobot's save_pretrained has written, or a function: it takes
        features by name, (E, …), pictures as (E, height, width, 3) uint8, and returns actions
        (E, na). If it has a method `reset`, this is called before the first action of episodes.
    data: the exported folder. Its meta/tangere.json says how features are made.
    task: None for that of the data set; a class of one in Python.
    seed: of the episodes; not that of the data set.
    num_envs: episodes that are played at once.

    Returns "task", "episodes", "seed", "successes", "success_rate", the bounds of its 95 % interval
    after Wilson in "interval", "mean_return" and "mean_actions". Raises InputError for a folder
    that `export` has not written, and for actions of another shape.
    """
    path = Path(data) / "meta/tangere.json"
    origin = json.loads(path.read_text(encoding="utf-8")) if path.is_file() else {}
    if "columns" not in origin:
        raise _core.InputError(f"{path} has no columns; expected a folder that export has written")
    if episodes < 1 or num_envs < 1:
        raise _core.InputError(f"episodes {episodes}, num_envs {num_envs}; expected at least 1")
    chosen = task if task is not None else origin["task"]
    if not chosen:
        raise _core.InputError(f"{data} is of a scene, which has no task to play")
    features = [
        Feature(**recipe) for recipe in origin["columns"] if recipe["name"].startswith("observ")
    ]
    if not callable(policy):
        policy = Checkpoint(policy, origin["text"])
    num_envs = min(num_envs, episodes)
    shown = {key for feature in features for key in feature.keys}
    env = _environment(chosen, num_envs, threads, shown, origin.get("windows", {}))
    start = getattr(policy, "reset", lambda: None)
    found = play_episodes(
        env, lambda obs: policy(_frames(env, obs, features)), start, episodes, seed
    )
    named = chosen if isinstance(chosen, str) else chosen.__name__
    return {"task": named, "seed": seed} | found


def _environment(
    task: str | type[scene_env.VectorSceneEnv], num_envs: int, threads: int | None,
    keys: set[str], windows: dict[str, Any],
) -> Any:  # fmt: skip
    """Shows the `keys`, of which `windows` says how many seconds lie between readings."""
    if not isinstance(task, str):
        return task(num_envs, threads=threads)
    if task not in _core.task_names():
        raise _core.InputError(f"task {task!r} is not of the catalogue; expected its class")
    scene = gym.task_scene(task)
    model = _core.Model(scene)
    sensors = [sensor.name for sensor in model.sensors]
    declared = {"q", "v", *(tensor.name for tensor in _core.task_spec(task).observations)}
    readings = [
        f"{key}/{round(windows[key]['seconds'] / model.timestep)}" if key in windows else key
        for key in sorted(keys - declared)
        if any(key == sensor or key.startswith(f"{sensor}.") for sensor in sensors)
    ]
    return gym.make_vec(
        task, num_envs, threads=threads, normalise=False, scene=scene, readings=readings
    )


def _frames(env: Any, obs: Frames, features: list[Feature]) -> Frames:
    keys = {key for feature in features for key in feature.keys}
    if keys & {"q", "v"}:
        q, v = env.state()[:2] if isinstance(env, gym.VectorTaskEnv) else (env.batch.q, env.batch.v)
        obs = {"q": q, "v": v} | obs
    if keys - obs.keys():
        raise _core.InputError(f"the task does not show {sorted(keys - obs.keys())}")
    return {feature.name: feature.rows(obs) for feature in features}
