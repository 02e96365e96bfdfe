# SPDX-License-Identifier: Apache-2.0
"""Tasks of one's own: a scene with rewards and ends written in Python, many at once or one.

    class Press(tangere.VectorSceneEnv):
        scene, steps_per_action, horizon = "press.xml", 10, 50

        def observe(self):
            return {"touch": self.batch.tactile("pad.sum"), "v": self.batch.v}

        def reward(self, actions):
            return -np.abs(self.batch.tactile("pad.sum")[:, 2] - 1)

    env = Press(num_envs=256)
    tangere.register_scene_env("Press-v0", Press)      # for gymnasium.make and make_vec
"""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Any, Literal, Sequence

import gymnasium
import numpy as np
from gymnasium import spaces
from gymnasium.envs.registration import load_env_creator
from gymnasium.vector.utils import batch_space
from numpy.typing import NDArray

from . import _core
from ._arrays import is_picture, numbers, singles
from ._rendering import MODES, RenderMode, Rendering
from ._row_readings import RowReadings
from ._vector_env import AUTORESET, Autoreset, EpisodesEnv, Observation
from ._vector_env import check_choices, checked_seed, final_info, system_seed
from .gym import SingleEnv

Indices = NDArray[np.int64]


class VectorSceneEnv(EpisodesEnv):
    """Many environments of a task of one's own. A subclass defines it by these members.

    Class attributes: `scene` (a file or a `tangere.Scene`), `steps_per_action` (simulation steps
    with the same controls), `horizon` (actions after which an episode is truncated), `actions`
    (numbers of an action; None: those of the controls), `action_low` and `action_high` (one number,
    or one per number of an action; actions are clipped to them), `warm_up` (whether an episode
    begins with an action of zeros, which does not count: the first observation is of the state
    after it), `readings` (of sensors, shown beside what `observe` returns and named as in `tangere
    generate --record`: "pad.sum", or "pad/5" for a window (E, n, …) of all readings since the row
    before, 5 steps apart). For data sets alone: `units` (KEY → unit of an observation, "action" →
    that of the actions), `privileged` (KEYs that a robot could not measure), `touch` (KEYs whose
    numbers are all 0 without contact). `arrays`: "torch" where the methods compute with tensors,
    for `tangere.torch.EnvTape`; `batch` returns tensors then.

    Methods, for all environments at once: `reward` is obligatory; `observe`, `controls`,
    `simulate`, `terminated`, `success` and `restart` have defaults. They read `self.batch`
    (`tangere.Batch`), `self.lengths` (E), the actions since the start of each episode, and
    `self.episodes` (E).

    Environment e plays episodes first_episode + e, first_episode + e + E, … of a seed. Scene draws
    (`<randomize>`) and `uniform` are the same for an episode, whatever the number of environments
    and threads. `info` has `success`, `starting`, `episode_id` and `status`, (E) each; a negative
    `status` says that the simulation failed: the environment stands still, its episode is
    truncated, and `reward` is what the method returns for the last state. Observations are float32
    in the units that `observe` returns, pictures in uint8 or int16 as they are; rewards float64.

    Parameters
    ----------
    num_envs: E.
    threads: None for all cores.
    seed, first_episode: which episodes the first reset starts, unless it is given a seed. None: a
        seed from the system.
    flatten: one array (E, n) instead of a dict, in the order of `observe`.
    autoreset: "next_step", "same_step" or "disabled", as in `VectorTaskEnv`.
    scene: another scene than that of the class.
    render_mode: "rgb_array" or "human", as in `VectorTaskEnv`.
    """

    scene: _core.Scene | str | Path
    steps_per_action: int = 1
    horizon: int = 100
    actions: int | None = None
    action_low: float | Sequence[float] = -1.0
    action_high: float | Sequence[float] = 1.0
    warm_up: bool = False
    readings: Sequence[str] = ()
    units: dict[str, str] = {}
    privileged: Sequence[str] = ()
    touch: Sequence[str] = ()
    arrays: Literal["numpy", "torch"] = "numpy"
    batch: Any  #: the environments' states: a `tangere.Batch`, or one that returns tensors
    lengths: NDArray[np.int64]  #: (E) actions since the start of each episode
    episodes: NDArray[np.int64]  #: (E) numbers of the episodes
    _given: Callable[[NDArray[np.float64]], Any] = staticmethod(lambda actions: actions)
    _ended: NDArray[np.bool_]
    _starting: NDArray[np.bool_]
    _terminated: NDArray[np.bool_]

    def __init__(
        self,
        num_envs: int = 1,
        *,
        threads: int | None = None,
        seed: int | None = None,
        first_episode: int = 0,
        flatten: bool = False,
        autoreset: Autoreset = "next_step",
        scene: _core.Scene | str | Path | None = None,
        render_mode: RenderMode = None,
    ) -> None:
        arguments = {k: v for k, v in locals().items() if k not in ("self", "__class__")}
        before = set(self.__dict__)
        self._arguments = arguments
        check_choices(num_envs, autoreset)
        self.num_envs, self.flatten, self.render_mode = num_envs, flatten, render_mode
        self._mode, self._threads, self._fresh = autoreset, threads, True
        self._seed = system_seed() if seed is None else checked_seed(seed)
        self._first_episode = first_episode
        if self.arrays not in ("numpy", "torch"):
            raise self._fault(f"arrays {self.arrays!r}", '"numpy" or "torch"')
        self.model = _core.Model(self._scene(scene))
        for name in ("steps_per_action", "horizon", "actions"):
            value = getattr(self, name)
            if name == "actions" and value is None:
                continue
            if not isinstance(value, (int, np.integer)) or value < 1:
                raise self._fault(f"{name} {value!r}", "a whole number from 1 on")
        sensors = [sensor.name for sensor in self.model.sensors]
        self._readings = RowReadings(self.readings, sensors, self.steps_per_action, self._fault)
        self.metadata = {
            "autoreset_mode": AUTORESET[autoreset],
            "render_modes": [*MODES],
            "render_fps": 1 / (self.model.timestep * self.steps_per_action),
        }
        self._rendering = Rendering(render_mode, self.metadata["render_fps"])
        shape = (self.model.nu if self.actions is None else self.actions,)
        try:
            low, high = (np.broadcast_to(b, shape) for b in (self.action_low, self.action_high))
        except ValueError:
            lengths = f"{np.size(self.action_low)} and {np.size(self.action_high)}"
            raise self._fault(f"{lengths} bounds of actions", f"1 or {shape[0]}") from None
        if not (low < high).all():
            bounds = f"action_low {self.action_low!r} and action_high {self.action_high!r}"
            raise self._fault(bounds, "the first below the second")
        self._low, self._high = low.astype(np.float64), high.astype(np.float64)
        self._zeros = np.clip(np.zeros(shape), self._low, self._high)
        self.single_action_space = spaces.Box(
            low.astype(np.float32), high.astype(np.float32), dtype=np.float32
        )
        self.action_space = batch_space(self.single_action_space, num_envs)
        self._start_all()
        seen = self._arrays()
        boxes: dict[str, spaces.Space[Any]] = {
            key: _box(array) for key, array in seen.items()
        }
        self._shapes = {key: array.shape for key, array in seen.items()}
        self._types = {key: array.dtype for key, array in seen.items()}
        width = sum(array[0].size for array in seen.values())
        self.single_observation_space = (
            spaces.Box(-np.inf, np.inf, (width,), np.float32) if flatten else spaces.Dict(boxes)
        )
        self.observation_space = batch_space(self.single_observation_space, num_envs)
        self._made = {*self.__dict__, "_made"} - before

    def __setstate__(self, state: dict[str, Any]) -> None:
        type(self).__init__(self, **state["arguments"])
        self.__dict__.update(state["kept"])

    # What a subclass defines

    def observe(self) -> dict[str, Any]:
        """KEY → (E, …). By default q, v and the sum of every sensor, in SI units."""
        sums = {s.name: self.batch.tactile(f"{s.name}.sum") for s in self.model.sensors}
        return {"q": self.batch.q, "v": self.batch.v} | sums

    def controls(self, actions: NDArray[np.float64]) -> Any:
        """(E, nu) of actions (E, na), or (steps_per_action, E, nu) where they change within an
        action. By default the actions themselves. Some environments may stand still: set arrays of
        the task in `simulate`."""
        return actions

    def simulate(self, controls: Any, envs: Indices) -> None:
        """Takes the steps of an action of the environments `envs` with the controls
        (steps_per_action, E, nu), as `batch.run` does. A task that reads something within an action
        takes them itself, with `every` and `fields`, and keeps the rows of `envs`. With windows in
        `readings` it calls this method."""
        self._readings.run(self.batch, controls, envs)

    def reward(self, actions: NDArray[np.float64]) -> Any:
        """(E) after the actions (E, na)."""
        raise NotImplementedError(f"{type(self).__name__} has no reward(actions)")

    def terminated(self) -> Any:
        """(E) bool, of no other type: the task ends the episode. By default it never does."""
        return np.zeros(self.num_envs, bool)

    def success(self) -> Any:
        """(E) bool, too: the task is solved in this state. By default where it is terminated."""
        return self.flags("terminated")

    def restart(self, envs: Indices) -> None:
        """Begins episodes of the environments `envs`, whose states the scene has drawn: for goals
        (`uniform`), numbers (`batch.set_randomized`) or other states (`batch.set_state`). By
        default nothing more."""

    # What it may use

    def uniform(self, envs: Indices, low: Any, high: Any) -> NDArray[np.float64]:
        """(len(envs), …): draws between `low` and `high`, numbers or arrays of one shape. An
        episode's first draw, second draw, … are the same in any environment."""
        low, high = np.broadcast_arrays(np.asarray(low, float), np.asarray(high, float))
        draws = np.empty((len(envs), *low.shape))
        for row, e in enumerate(envs):
            random = self._random.get(int(e))
            if random is None:
                random = np.random.default_rng((self._seed, int(self.episodes[e])))
                self._random[int(e)] = random
            draws[row] = random.uniform(low, high)
        return draws

    # Gymnasium's interface

    def _show(self) -> None:
        self._rendering.show(self._batch, self.episodes)

    def step(
        self, actions: Any
    ) -> tuple[Observation, NDArray[Any], NDArray[Any], NDArray[Any], dict[str, Any]]:
        """Takes one action of every environment, (E, na) or (na) for all, clipped to its bounds.
        One whose episode has ended starts the next one instead, or stands still (`autoreset`).

        Returns observations, rewards (E) float64, terminated, truncated (E) bool, info. Everything
        is new at every step. Raises InputError for actions, controls, rewards or ends of another
        shape, and for rewards or observations that are not finite.
        """
        actions = numbers(actions)
        one, many = self._low.shape, (self.num_envs, *self._low.shape)
        if actions.shape not in (one, many):
            raise _core.InputError(f"actions of shape {actions.shape}; expected {many} or {one}")
        ended = self._ended.copy()
        self._fresh = False
        self._starting[:] = False
        actions = np.clip(np.broadcast_to(actions, many), self._low, self._high)
        moving = ~ended
        if self._mode == "next_step":
            self._start_next(ended, warm_up=False)
            actions[ended] = self._zeros
            moving |= self.warm_up
        self._act(actions, np.flatnonzero(moving))
        self.lengths[~ended] += 1
        reward = self._row("reward", self.reward(self._given(actions))).astype(np.float64)
        reward = np.where(ended, 0.0, reward)
        if not np.isfinite(reward).all():
            e = int(np.flatnonzero(~np.isfinite(reward))[0])
            raise self._fault(f"reward() {reward[e]} in environment {e}", "a finite number")
        terminated = self.flags("terminated") & ~ended
        failed = self._batch.status < 0
        truncated = ((self.lengths >= self.horizon) | failed) & ~terminated & ~ended
        if self._mode == "disabled":  # those that stand still stay as they ended
            terminated |= ended & self._terminated
            truncated |= ended & ~self._terminated
        self._terminated, self._ended = terminated.copy(), terminated | truncated
        info = self._info()
        if self._mode == "same_step" and self._ended.any():
            last, ends = self._observe(), self._ended.copy()
            self._start_next(ends)
            info = self._info() | final_info(last, info, ends)
        self._show()
        return self._observe(), reward, terminated, truncated, info

    def render(self) -> tuple[NDArray[np.uint8], ...] | None:
        """A picture of every environment, (384, 512, 3) uint8 or what the scene's first camera
        sees, or None, as in `VectorTaskEnv`."""
        return self._rendering.render(self._batch, self.episodes)

    def close_extras(self, **_: Any) -> None:
        """Closes the window; `close` calls it."""
        self._rendering.close()

    @property
    def windows(self) -> dict[str, float]:
        """KEY → time between the readings of a window [s], of those that `readings` names."""
        return {key: n * self.model.timestep for key, n in self._readings.windows.items()}

    @property
    def bounds(self) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """(na) each: least and largest actions."""
        return self._low, self._high

    def flags(self, name: Literal["terminated", "success"]) -> NDArray[np.bool_]:
        """(E): what the method of that name returns now. Raises InputError for another shape or
        type."""
        row = self._row(name, getattr(self, name)())
        if row.dtype != bool:
            e = int(np.argmax((row != 0) & (row != 1)))
            found = f"{row.dtype}, {row.tolist()[e]!r} in environment {e}"
            raise self._fault(f"{name}() of {found}", "bool")
        return row.copy()

    def randomized(self) -> dict[str, NDArray[np.float64]]:
        """Name → (E): the numbers of the episodes that vary, as `Batch.randomized`."""
        return self._batch.randomized()

    def _scene(self, other: _core.Scene | str | Path | None) -> _core.Scene:
        scene = getattr(self, "scene", None) if other is None else other
        if scene is None:
            raise self._fault("no scene", "a class attribute `scene`, or the argument")
        return scene if isinstance(scene, _core.Scene) else _core.Scene(scene)

    def _fault(self, what: str, expected: str) -> _core.InputError:
        return _core.InputError(f"{type(self).__name__}: {what}; expected {expected}")

    def _start_all(self) -> None:
        self._batch = _core.Batch(
            self.model, self.num_envs, self._seed, self._first_episode, self._threads
        )
        self.batch = self._batch
        if self.arrays == "torch":  # which not everybody has
            from ._tensor_batch import TensorBatch, tensors

            self.batch, self._given = TensorBatch(self._batch), tensors
        self.episodes = self._first_episode + np.arange(self.num_envs)
        self.lengths = np.zeros(self.num_envs, np.int64)
        self._ended = np.zeros(self.num_envs, bool)
        self._starting = np.zeros(self.num_envs, bool)
        self._terminated = np.zeros(self.num_envs, bool)
        self._random: dict[int, np.random.Generator] = {}
        self._rendering.clear()
        self._start(np.arange(self.num_envs), self.episodes.copy())

    def _start_next(self, which: NDArray[np.bool_], warm_up: bool = True) -> None:
        envs = np.flatnonzero(which)
        self._start(envs, self.episodes[envs] + self.num_envs, warm_up)

    def _start(self, envs: Indices, episodes: NDArray[np.int64], warm_up: bool = True) -> None:
        if len(envs):
            self.episodes[envs] = episodes
            self._batch.reset(envs, episodes.tolist())
            self._begin(envs)
            self._readings.start(self.batch, envs)
            if self.warm_up and warm_up:
                self._act(np.tile(self._zeros, (self.num_envs, 1)), envs)

    def _act(self, actions: NDArray[np.float64], envs: Indices) -> None:
        """Takes the actions (E, na) of some environments; the others stand still."""
        controls = np.asarray(numbers(self.controls(self._given(actions))), np.float64)
        shape = self._shape_of_controls(controls)
        if len(envs):
            self._readings.expect()
            self.simulate(self._given(np.array(np.broadcast_to(controls, shape))), envs)
            self._readings.check()

    def _shape_of_controls(self, controls: Any) -> tuple[int, int, int]:
        """(steps_per_action, E, nu). Raises InputError where controls() returned another shape."""
        steps, count, nu = self.steps_per_action, self.num_envs, self.model.nu
        if tuple(controls.shape) not in ((steps, count, nu), (count, nu), (nu,)):
            expected = f"({count}, {nu}) or ({steps}, {count}, {nu})"
            raise self._fault(f"controls() of shape {tuple(controls.shape)}", expected)
        return steps, count, nu

    def _begin(self, envs: Indices) -> None:
        self._ended[envs], self._starting[envs], self.lengths[envs] = False, True, 0
        for e in envs:
            self._random.pop(int(e), None)
        self.restart(envs)

    def _row(self, name: str, value: Any) -> NDArray[Any]:
        row = numbers(value)
        if row.shape != (self.num_envs,):
            raise self._fault(f"{name}() of shape {row.shape}", f"({self.num_envs},)")
        return row

    def _arrays(self) -> dict[str, NDArray[np.float32]]:
        seen = self.observe()
        if not isinstance(seen, dict) or not seen:
            raise self._fault(f"observe() {type(seen).__name__}", "a dict KEY → (E, …)")
        if self._readings.between:
            for key in seen.keys() & self._readings.between.keys():
                found = f"observe()[{key!r}], which is in `readings`"
                raise self._fault(found, "it in one of both")
            seen = seen | self._readings.rows(self.batch)
        given = {k: numbers(a) for k, a in seen.items()}
        arrays = {k: a.copy() if is_picture(a) else singles(a) for k, a in given.items()}
        for key, array in arrays.items():
            if array.ndim < 1 or len(array) != self.num_envs:
                raise self._fault(f"observe()[{key!r}] of shape {array.shape}",
                                  f"({self.num_envs}, …)")  # fmt: skip
            # A sum costs less than a test of each number, and is not finite where one is not.
            if array.dtype == np.float32 and not np.isfinite(array.sum()):
                failed = self._batch.status < 0  # also because a state is out of float32's range
                array[failed] = np.nan_to_num(array[failed])
                if not np.isfinite(array).all():
                    what = f"observe()[{key!r}] with numbers that are not finite in float32"
                    raise self._fault(what, "finite ones")
        return arrays

    def _observe(self) -> Observation:
        arrays = self._arrays()
        shapes = {key: array.shape for key, array in arrays.items()}
        if shapes != self._shapes:
            raise self._fault(f"observe() of shapes {shapes}", f"{self._shapes}")
        if not self.flatten:
            return arrays
        flat = [a.reshape(self.num_envs, -1) for a in arrays.values()]
        return np.concatenate(flat, axis=1, dtype=np.float32)

    def _info(self) -> dict[str, Any]:
        every = np.ones(self.num_envs, bool)
        info = {
            "success": self.flags("success"),
            "starting": self._starting.copy(),
            "episode_id": self.episodes.copy(),
            "status": self._batch.status,
        }
        return info | {f"_{key}": every.copy() for key in info}


def _box(array: NDArray[Any]) -> spaces.Box:
    """The space of an observation whose first (E, …) is given."""
    if array.dtype == np.uint8:
        return spaces.Box(0, 255, array.shape[1:], np.uint8)
    if array.dtype == np.int16:
        return spaces.Box(-32768, 32767, array.shape[1:], np.int16)
    return spaces.Box(-np.inf, np.inf, array.shape[1:], np.float32)


class SceneEnv(SingleEnv):
    """One environment of a task of one's own, with the episodes of its vector.

    Parameters
    ----------
    task: the subclass of `VectorSceneEnv`, or "MODULE:CLASS" of it, as data sets name it.
    arguments: those of `VectorSceneEnv`, without num_envs and autoreset.
    """

    def __init__(self, task: type[VectorSceneEnv] | str, **arguments: Any) -> None:
        given: dict[str, Any] = {"threads": 1, "autoreset": "disabled"} | arguments
        made: Any = load_env_creator(task) if isinstance(task, str) else task
        super().__init__(made(1, **given))

    def randomized(self) -> dict[str, float]:
        """Name → the numbers of the episode that vary, as `Batch.randomized`."""
        return {name: float(values[0]) for name, values in self._vector.randomized().items()}


def register_scene_env(name: str, task: type[VectorSceneEnv], **arguments: Any) -> None:
    """Registers a task with Gymnasium under an id, such as "Press-v0".

    `gymnasium.make(name)` is one environment, `gymnasium.make_vec(name, E)` many at once.
    `arguments` of the environments become defaults.
    """
    gymnasium.register(
        name,
        entry_point="tangere.scene_env:SceneEnv",
        vector_entry_point="tangere.scene_env:_make_vec",
        max_episode_steps=task.horizon,
        kwargs={"task": task, **arguments},
    )


def _make_vec(
    task: type[VectorSceneEnv], num_envs: int = 1, max_episode_steps: Any = None, **arguments: Any
) -> VectorSceneEnv:
    if max_episode_steps not in (None, task.horizon):
        raise _core.InputError(
            f"max_episode_steps {max_episode_steps!r}; the horizon of {task.__name__} is "
            f"{task.horizon}"
        )
    return task(num_envs, **arguments)


def registered_task(name: str) -> tuple[str | type[VectorSceneEnv], dict[str, Any]]:
    """The task of an id of Gymnasium, a name of the catalogue or a class, and its arguments.

    Raises InputError if the environment of that id is none of tangere.
    """
    arguments = dict(gymnasium.spec(name).kwargs)
    task = arguments.pop("task", None)
    if isinstance(task, type) and issubclass(task, VectorSceneEnv) or task in _core.task_names():
        return task, arguments
    raise _core.InputError(
        f"{name!r} of Gymnasium is no environment of tangere; expected one that "
        "register_scene_env() made, or a task of the catalogue"
    )
