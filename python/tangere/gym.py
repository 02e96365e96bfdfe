# SPDX-License-Identifier: Apache-2.0
"""Tasks as Gymnasium environments: many at once (`make_vec`), or one (`gymnasium.make`).

Observations are float32, divided by the scales that the task declares; actions are bounded by what
the task declares, [-1, 1] for every task but `dummy`. Rewards are float64.
"""

from __future__ import annotations

import copyreg
import json
import warnings
from pathlib import Path
from typing import Any, Sequence

import gymnasium
import numpy as np
from gymnasium import spaces
from gymnasium.vector import AutoresetMode
from gymnasium.vector.utils import batch_space

from . import _core
from ._arrays import numbers
from ._rendering import MODES, RenderMode, Rendering
from ._vector_env import AUTORESET, Autoreset, EpisodesEnv, Observation, Remade
from ._vector_env import check_choices, checked_seed, final_info, system_seed


def gym_id(task: str) -> str:
    """The id of a task: "box_pushing" → "tangere/BoxPushing-v0"."""
    return f"tangere/{''.join(word.capitalize() for word in task.split('_'))}-v0"


def task_scene(task: str, other: _core.Scene | str | Path | None = None) -> _core.Scene:
    """The scene of a task, from the package, or in its place `other`: a scene or its file."""
    if other is not None:
        return other if isinstance(other, _core.Scene) else _core.Scene(other)
    return _core.Scene(Path(__file__).parent / "scenes" / _core.task_spec(task).scene)


def observation_scale(tensor: _core.TensorSpec) -> float | list[float]:
    """What observations of a key are divided by: one number, or one per place on the last axis."""
    if len(tensor.scale) > 1:
        return list(tensor.scale)
    return tensor.scale[0] if tensor.scale else 1.0


def observation_space(
    tensors: Sequence[_core.TensorSpec], normalise: bool, flatten: bool
) -> spaces.Space:
    """The space of one environment's observations, which are `tensors`."""
    boxes: dict[str, spaces.Space] = {}
    parts: list[spaces.Box] = []
    for tensor in tensors:
        scale = np.broadcast_to(np.asarray(observation_scale(tensor)), tensor.shape)
        by = scale if normalise else np.ones(tensor.shape)
        low, high = tensor.low / by, tensor.high / by
        kind: Any = np.uint8 if tensor.own_bytes == 1 else np.float32
        box = spaces.Box(low.astype(kind), high.astype(kind), dtype=kind)
        boxes[tensor.name] = box
        parts.append(box)
    if not flatten:
        return spaces.Dict(boxes)
    low = np.concatenate([box.low.ravel() for box in parts], dtype=np.float32)
    high = np.concatenate([box.high.ravel() for box in parts], dtype=np.float32)
    return spaces.Box(low, high)


def _scene_as_read(path: str, text: str, varying: list[str]) -> _core.Scene:
    """The scene of a pickle: read from its file again, then with the numbers of `Scene.vary`."""
    if Path(path).is_file():
        with warnings.catch_warnings():  # they came when the scene was read first
            warnings.simplefilter("ignore", UserWarning)
            scene = _core.Scene(path, allow_unknown=True)
        if scene.text != text:
            raise _core.InputError(f"{path}: the file is not as it was when its scene was pickled")
    else:
        scene = _core.Scene.from_string(text, path)
    drawn = set(scene.varying)
    return scene.vary([name for name in varying if name not in drawn])


copyreg.pickle(
    _core.Scene, lambda scene: (_scene_as_read, (scene.path, scene.text, scene.varying))
)


class VectorTaskEnv(EpisodesEnv):
    """Many environments of one task, stepped in C++ on all cores with one call a step.

    Environment e plays episodes first_episode + e, first_episode + e + E, … of a seed: an episode
    is the same, bit for bit, for every number of environments and threads. `reset(seed=s)` starts
    the first of them, `reset()` the next ones. `info` has `success`, `starting`, `episode_id` and
    `status`, (E) each; `status` is negative where the simulation failed, which truncates the
    episode.

    Parameters
    ----------
    task: a name of `tangere.task_names()`.
    num_envs: E.
    threads: None for all cores.
    seed, first_episode: which episodes the first reset starts, unless it is given a seed. None: a
        seed from the system, another one each time.
    normalise: divide observations by `observation_scale`; otherwise they are in SI units.
    flatten: one array (E, n) instead of a dict, in the order in which the task declares its keys.
    autoreset: what follows the end of an episode. "next_step": the next step ignores its action
        and shows the start of the next episode, with reward 0. "same_step": observation and info
        are those of the start already; `info["final_obs"]` and `info["final_info"]` hold the last
        ones of the episode.
        "disabled": the environment stands still until `reset(options={"reset_mask": m})`.
    keys: the observations to show; None for all that the task declares.
    readings: of sensors of the scene to show beside them, named as in `tangere generate --record`:
        "pad.sum" at every row, "pad/1" as a window of all readings since the row before, (E, n, …).
        In SI units, with the numbers of the data set. They are shown whatever `keys` says, which
        may then be [].
    scene: another scene than the one of the task, or the path of its file.
    render_mode: "rgb_array" for pictures by `render`; "human" for a window, which every reset and
        step draws anew, at most `metadata["render_fps"]` times a second. It needs pygame.
    """

    def __init__(
        self,
        task: str,
        num_envs: int,
        *,
        threads: int | None = None,
        seed: int | None = None,
        first_episode: int = 0,
        normalise: bool = True,
        flatten: bool = False,
        autoreset: Autoreset = "next_step",
        keys: Sequence[str] | None = None,
        readings: Sequence[str] = (),
        scene: _core.Scene | str | Path | None = None,
        render_mode: RenderMode = None,
    ) -> None:
        arguments = {k: v for k, v in locals().items() if k not in ("self", "__class__")}
        before = set(self.__dict__)
        self._arguments = arguments
        for argument, words in (("keys", keys), ("readings", readings)):
            if isinstance(words, str):
                expected = f"expected a list, such as [{words!r}]"
                raise _core.InputError(f"{argument} {words!r}; {expected}")
        seed = system_seed() if seed is None else checked_seed(seed)
        check_choices(num_envs, autoreset)
        self.task = _core.task_spec(task)
        names = [tensor.name for tensor in self.task.observations]
        unknown = [key for key in keys or () if key not in names]
        if unknown or keys is not None and not keys and not readings:
            raise _core.InputError(f"keys {list(keys or ())}; task {task!r} has {names}")
        self.keys = [name for name in names if keys is None or name in keys]
        self.normalise, self.flatten = normalise, flatten
        self.num_envs = num_envs
        self._mode = autoreset
        self._env = _core.Environments(
            task,
            task_scene(task, scene),
            num_envs,
            seed=seed,
            first_episode=first_episode,
            threads=threads,
            autoreset=autoreset == "next_step",
            readings=list(readings),
        )
        self._readings = self._env.reading_specs
        self._seed, self._first_episode, self._fresh = seed, first_episode, True
        self.render_mode = render_mode
        self.metadata = {
            "autoreset_mode": AUTORESET[autoreset],
            "render_modes": [*MODES],
            "render_fps": 1 / (self.model.timestep * self.task.steps_per_action),
        }
        self._rendering = Rendering(render_mode, self.metadata["render_fps"])
        action = self.task.action
        self.single_action_space = spaces.Box(action.low, action.high, action.shape, np.float32)
        self.action_space = batch_space(self.single_action_space, num_envs)
        shown = [tensor for tensor in self.task.observations if tensor.name in self.keys]
        self.single_observation_space = observation_space(
            [*shown, *self._readings], normalise, flatten
        )
        self.observation_space = batch_space(self.single_observation_space, num_envs)
        self._made = {*self.__dict__, "_made"} - before

    def __setstate__(self, state: dict[str, Any]) -> None:
        VectorTaskEnv.__init__(self, **state["arguments"])
        self.__dict__.update(state["kept"])

    @property
    def autoreset_mode(self) -> AutoresetMode:
        """What follows the end of an episode, as `metadata["autoreset_mode"]`."""
        return self.metadata["autoreset_mode"]

    @property
    def observation_scale(self) -> dict[str, float | list[float]]:
        """KEY → what its observations are divided by, in SI units; of readings 1."""
        shown = [*self.task.observations, *self._readings]
        return {tensor.name: observation_scale(tensor) for tensor in shown}

    @property
    def windows(self) -> dict[str, float]:
        """KEY → time between the readings of a window [s], of those that `readings` names."""
        return self._env.windows

    @property
    def model(self) -> _core.Model:
        """The compiled scene."""
        return self._env.model

    def _start_all(self) -> None:
        self._env.reset(self._seed, self._first_episode)
        self._rendering.clear()

    def _start_next(self, which: np.ndarray) -> None:
        self._env.restart(which)

    def _show(self) -> None:
        self._rendering.show(self._env, self._env.episodes())

    def step(
        self, actions: Any
    ) -> tuple[Observation, np.ndarray, np.ndarray, np.ndarray, dict[str, Any]]:
        """Takes one action of every environment, (E, na) or (na) for all, clipped to its bounds.

        Returns observations, rewards (E) float64, terminated, truncated (E) bool, info. Everything
        is new at every step.
        """
        self._fresh = False
        actions = numbers(actions)
        if actions.shape != self.action_space.shape and actions.shape != self.task.action.shape:
            expected = f"{self.action_space.shape} or {self.task.action.shape}"
            raise _core.InputError(f"actions of shape {actions.shape}; expected {expected}")
        self._env.step(actions)
        reward, terminated, truncated = (
            self._env.rewards(),
            self._env.terminated(),
            self._env.truncated(),
        )
        info = self._info()
        ended = terminated | truncated
        if self._mode == "same_step" and ended.any():
            last, final = self._observe(), info
            self._env.restart(ended)
            info = self._info() | final_info(last, final, ended)
        self._show()
        return self._observe(), reward, terminated, truncated, info

    def scripted_action(self) -> np.ndarray:
        """(E, na): what the task's own script does here. It may use the whole state."""
        return self._env.scripted()

    def state(self) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """q (E, nq), v (E, nv) and the task's memory, (E, n): privileged, float64, SI units."""
        return self._env.state()

    def randomized(self) -> dict[str, np.ndarray]:
        """Name → (E): what <randomize> drew for the episodes, such as "tactile pad kt": privileged.

        In SI units. Numbers of the starting state are those of the scene; a task may start
        elsewhere.
        """
        return self._env.randomized()

    def render(self) -> tuple[np.ndarray, ...] | None:
        """A picture of every environment: (384, 512, 3) uint8, or what the first camera of the
        scene sees, if it has one. None without `render_mode`, and with
        "human", which shows the first 16 environments in a window.

        Bodies and the ground, seen from the side and above without perspective. Fields of sensors
        are not shown. Raises IoError where no window can be opened.
        """
        return self._rendering.render(self._env, self._env.episodes())

    def close_extras(self, **_: Any) -> None:
        """Closes the window; `close` calls it."""
        self._rendering.close()

    def counts(self) -> dict[str, int]:
        """As Environments.counts(), since the last reset by seed."""
        return self._env.counts()

    def _observe(self) -> Observation:
        arrays = self._env.observations(self.normalise, self.keys) | self._env.readings()
        if not self.flatten:
            return arrays
        parts = [array.reshape(self.num_envs, -1) for array in arrays.values()]
        return np.concatenate(parts, axis=1, dtype=np.float32)

    def _info(self) -> dict[str, Any]:
        every = np.ones(self.num_envs, bool)
        info = {
            "success": self._env.success(),
            "starting": self._env.starting(),
            "episode_id": self._env.episodes(),
            "status": self._env.status(),
        }
        return info | {f"_{key}": every.copy() for key in info}


class SingleEnv(gymnasium.Env):
    """The one environment of a vector of one, whose autoreset is disabled.

    `reset(seed=s)` starts episode `first_episode` of seed s, `reset()` the next one.
    """

    metadata = {"render_modes": [*MODES]}

    def __init__(self, vector: Any) -> None:
        self._vector = vector
        self.action_space = vector.single_action_space
        self.observation_space = vector.single_observation_space
        self._over = True
        self.render_mode = vector.render_mode
        self.metadata = {k: v for k, v in vector.metadata.items() if k != "autoreset_mode"}

    def reset(
        self, *, seed: int | None = None, options: dict[str, Any] | None = None
    ) -> tuple[Observation, dict[str, Any]]:
        """Starts an episode; see the class."""
        super().reset(seed=seed)
        obs, info = self._vector.reset(seed=seed, options=options)
        self._over = False
        return self._one(obs), self._info(info)

    def step(self, action: Any) -> tuple[Observation, float, bool, bool, dict[str, Any]]:
        """Takes one action (na). Raises InputError after the end of an episode."""
        if self._over:
            raise _core.InputError("step() without an episode; call reset() first")
        action = numbers(action)
        if action.shape != self.action_space.shape and action.size != 1:
            raise _core.InputError(
                f"an action of shape {action.shape}; expected {self.action_space.shape}"
            )
        obs, reward, terminated, truncated, info = self._vector.step(action.reshape(1, -1))
        self._over = bool(terminated[0] or truncated[0])
        return (
            self._one(obs),
            float(reward[0]),
            bool(terminated[0]),
            bool(truncated[0]),
            self._info(info),
        )

    @property
    def model(self) -> _core.Model:
        """The compiled scene."""
        return self._vector.model

    def render(self) -> np.ndarray | None:
        """A picture, or None, as in `VectorTaskEnv`."""
        pictures = self._vector.render()
        return None if pictures is None else pictures[0]

    def close(self) -> None:
        """Closes the window of render_mode "human"."""
        self._vector.close()

    def _one(self, obs: Observation) -> Observation:
        return obs[0] if self._vector.flatten else {key: value[0] for key, value in obs.items()}

    @staticmethod
    def _info(info: dict[str, Any]) -> dict[str, Any]:
        return {key: value[0].item() for key, value in info.items() if not key.startswith("_")}


class TaskEnv(Remade, SingleEnv):
    """One environment of a task, for evaluation. The episodes are those of `VectorTaskEnv`.

    `reset(seed=s)` starts episode `first_episode` of seed s, `reset()` the next one.
    """

    def __init__(
        self,
        task: str,
        *,
        seed: int | None = None,
        first_episode: int = 0,
        normalise: bool = True,
        flatten: bool = False,
        keys: Sequence[str] | None = None,
        readings: Sequence[str] = (),
        scene: _core.Scene | str | Path | None = None,
        render_mode: RenderMode = None,
    ):
        arguments = {k: v for k, v in locals().items() if k not in ("self", "__class__")}
        before = set(self.__dict__)
        self._arguments = arguments
        vector = VectorTaskEnv(
            task,
            1,
            threads=1,
            seed=seed,
            first_episode=first_episode,
            normalise=normalise,
            flatten=flatten,
            autoreset="disabled",
            keys=keys,
            readings=readings,
            scene=scene,
            render_mode=render_mode,
        )
        SingleEnv.__init__(self, vector)
        self.task = vector.task
        self._made = {*self.__dict__, "_made"} - before

    def __setstate__(self, state: dict[str, Any]) -> None:
        TaskEnv.__init__(self, **state["arguments"])
        self.__dict__.update(state["kept"])

    @property
    def observation_scale(self) -> dict[str, float | list[float]]:
        """KEY → what its observations are divided by, in SI units; of readings 1."""
        return self._vector.observation_scale

    @property
    def windows(self) -> dict[str, float]:
        """KEY → time between the readings of a window [s], as in `VectorTaskEnv`."""
        return self._vector.windows

    def scripted_action(self) -> np.ndarray:
        """(na): what the task's own script does here. It may use the whole state."""
        return self._vector.scripted_action()[0]

    def state(self) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """q, v and the task's memory: privileged, float64, SI units."""
        q, v, memory = self._vector.state()
        return q[0], v[0], memory[0]

    def randomized(self) -> dict[str, float]:
        """Name → what <randomize> drew for the episode, as in `VectorTaskEnv`."""
        return {name: float(values[0]) for name, values in self._vector.randomized().items()}


def make_vec(
    task: str, num_envs: int = 1, *, max_episode_steps: int | None = None, **arguments: Any
) -> VectorTaskEnv:
    """Many environments of one task; `arguments` are those of `VectorTaskEnv`.

    `max_episode_steps` comes from `gymnasium.make_vec`; it can only be the task's horizon.
    """
    horizon = _core.task_spec(task).horizon
    if max_episode_steps not in (None, horizon):
        raise _core.InputError(
            f"max_episode_steps {max_episode_steps!r}; the horizon of task {task!r} is {horizon}"
        )
    return VectorTaskEnv(task, num_envs, **arguments)


def make_env(task: str, **arguments: Any) -> TaskEnv:
    """One environment of a task; `arguments` are those of `TaskEnv`."""
    return TaskEnv(task, **arguments)


def env_spec_json(task: str, **arguments: Any) -> str:
    """The text from which `gymnasium.make` makes the environment, wherever it is read."""
    return json.dumps(
        {
            "id": gym_id(task),
            "entry_point": "tangere.gym:make_env",
            "reward_threshold": None,
            "nondeterministic": False,
            "max_episode_steps": _core.task_spec(task).horizon,
            "order_enforce": True,
            "disable_env_checker": False,
            "kwargs": {"task": task, **arguments},
            "additional_wrappers": [],
            "vector_entry_point": None,
        }
    )


def register_tasks() -> None:
    """Registers every task with Gymnasium. `import tangere` has done it."""
    for task in _core.task_names():
        if gym_id(task) not in gymnasium.registry:
            gymnasium.register(
                gym_id(task),
                entry_point="tangere.gym:make_env",
                vector_entry_point="tangere.gym:make_vec",
                max_episode_steps=_core.task_spec(task).horizon,
                kwargs={"task": task},
            )
