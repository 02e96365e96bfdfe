# SPDX-License-Identifier: Apache-2.0
"""Data sets of tasks that are written in Python: many environments play, C++ writes the files.

An environment that ends an episode takes the next one that nobody plays. Blocks of 16 episodes go
to the writer whole and in ascending order, so the files depend on neither environments nor threads.
"""

from __future__ import annotations

import heapq
from collections import deque
from contextlib import closing
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, Iterator, Sequence

import numpy as np
from numpy.typing import NDArray

from . import _core
from ._arrays import numbers, singles
from .policy import Choose
from .scene_env import Indices, VectorSceneEnv

_BLOCK = 16  # episodes that are written together
_STATE = ("q", "v")  # what every data set stores
_TAKEN = ("actions", "rewards", "dones")  # names of other arrays of an episode
_EXISTING = {"--overwrite": "replace", "--resume": "keep"}
_COUNTS = ("simulation_steps", "tunnelled_steps", "overlapping_steps")


def generate(
    task: type[VectorSceneEnv],
    output: str | Path,
    episodes: int,
    *,
    policy: Choose | str | None,
    name: str | None,
    seed: int,
    threads: int | None,
    num_envs: int,
    options: Sequence[str],
    arguments: dict[str, Any],
    registered: str | None,
) -> dict[str, Any]:
    """`tangere.data.generate` of a task in Python.

    `name`: of the function `policy`. `arguments`: of the class, `registered`: its id of Gymnasium.
    """
    if not callable(policy) and policy != "random":
        raise _core.InputError(
            f"policy {policy!r} of {task.__name__}; expected a function or 'random'"
        )
    if episodes < 1:
        raise _core.InputError(f"{episodes} episodes; expected 1 or more")
    own = {"threads": threads, "seed": seed, "autoreset": "disabled"}
    if repeated := [key for key in arguments if own.get(key) is not None]:
        raise _core.InputError(f"{registered!r} is registered with {repeated}; expected none of it")
    env = task(min(num_envs, episodes), **(own | arguments))
    spec, kind = _spec(env), "program" if callable(policy) else "random"
    player = name if name and callable(policy) else kind
    where = f"{task.__module__}:{task.__qualname__}"
    lasting = [word for word in options if word not in _EXISTING]
    what = repr(registered) if registered else where
    again = f"tangere.data.generate({what}, OUTPUT, {episodes}, policy={player}, seed={seed}"
    again += f", options={lasting})" if lasting else ")"
    writer = _core.EpisodeWriter(
        env.model, spec, str(output), episodes, seed, kind, player, where, again,
        readings=env._readings.words, **_storage(options, spec.name),
    )  # fmt: skip
    with closing(writer):
        run = _Run(env, policy if callable(policy) else None, writer)
        run.play()
        said = {"task": spec.name, "policy": kind} | run.said()
        return said | dict(writer.finish())


def _storage(options: Sequence[str], task: str) -> dict[str, Any]:
    """Arguments of the writer for words of the command."""
    given: dict[str, Any] = {}
    words = iter(options)
    for word in words:
        if word in _EXISTING and "existing" not in given:
            given["existing"] = _EXISTING[word]
            continue
        value = next(words, "")
        if word == "--compress" and value in ("none", "deflate", "lz4"):
            given["compression"] = value
        elif word == "--pictures" and value:
            given["pictures"] = value
        elif word == "--tactile" and value in ("dense", "sparse"):
            given["sparse"] = value == "sparse"
        elif word == "--name" and value:
            given["set_name"] = value
        elif word == "--shards" and value.isdecimal() and int(value) > 0:
            given["shards"] = int(value)
        else:
            raise _core.InputError(
                f"options {list(options)} of {task}: {word!r} with {value!r}; expected --overwrite "
                "or --resume, --compress none, deflate or lz4, --pictures raw or jpeg:QUALITY, "
                "--tactile dense or sparse, --name NAME, --shards N"
            )
    return given


def _spec(env: VectorSceneEnv) -> _core.TaskSpec:
    """What the files say of the task."""
    if type(env).__name__ in _core.task_names():
        raise env._fault("the name of a task of the catalogue", "another name of the class")
    for key in _TAKEN:
        if key in env._shapes:
            raise env._fault(f"observe()[{key!r}], the name of another array", "another name")
    for member in ("units", "privileged", "touch"):
        known = [*env._shapes, "action"] if member == "units" else [*env._shapes]
        unknown = [key for key in getattr(env, member) if key not in known]
        if unknown:
            raise env._fault(f"{member} {unknown}", f"some of {known}")
    low, high = env._low, env._high
    same = (low == low[0]).all() and (high == high[0]).all()
    action = _core.TensorSpec(
        "action", low.shape, env.units.get("action", ""),
        "" if same else f"from {low.tolist()} to {high.tolist()}", low.min(), high.max(),
    )  # fmt: skip
    seen = [
        _core.TensorSpec(
            key, shape[1:], env.units.get(key, ""),
            privileged=key in env.privileged, touch=key in env.touch,
            own_bytes=0 if env._types[key] == np.float32 else env._types[key].itemsize,
        )  # fmt: skip
        for key, shape in env._shapes.items()
        if key not in (*_STATE, *env._readings.between)
    ]
    scene = env.model.scene
    return _core.TaskSpec(
        type(env).__name__, scene.path or scene.name, f"{type(env).__name__}.success()", action,
        seen, int(env.steps_per_action), int(env.horizon),
    )  # fmt: skip


@dataclass
class _Block:
    """Consecutive episodes from `first` on, in slots from `slot` on."""

    first: int
    count: int
    slot: int
    begun: int = 0
    ended: int = 0
    steps: NDArray[np.int64] = field(default_factory=lambda: np.zeros(len(_COUNTS), np.int64))
    failures: list[tuple[int, int, int, list[float], list[float]]] = field(default_factory=list)


class _Run:
    """Plays the missing episodes of a data set. A slot has the rows of one episode."""

    def __init__(
        self, env: VectorSceneEnv, policy: Choose | None, writer: _core.EpisodeWriter
    ) -> None:
        self.env, self.policy, self.writer = env, policy, writer
        self.width = len(env._low)
        # Twice as many as are played, because some wait for a longer episode before them.
        places = 2 * -(-env.num_envs // _BLOCK)
        slots, most = places * _BLOCK, env.horizon
        state = {"q": (env.model.nq,), "v": (env.model.nv,)}
        seen = {key: shape[1:] for key, shape in env._shapes.items()} | state
        shapes = {key: seen[key] for key in writer.observation_names}
        try:  # memory is taken when rows are written
            self.rows = {
                k: np.empty((slots, most + 1, *s), env._types.get(k, np.float32))
                for k, s in shapes.items()
            }
            self.actions = np.empty((slots, most, self.width), np.float32)
            self.rewards = np.empty((slots, most), np.float32)
        except MemoryError:
            of_row = 4 * (sum(int(np.prod(s)) for s in shapes.values()) + self.width + 1)
            raise _core.InputError(
                f"no memory for {slots} episodes of {most * of_row} bytes; expected a smaller "
                "num_envs, horizon or observation"
            ) from None
        self.randomized = np.empty((slots, len(env.randomized())))
        self.lengths, self.returns = np.empty(slots, np.int64), np.empty(slots)
        self.terminated, self.success = np.empty(slots, bool), np.empty(slots, bool)
        self.slot = np.full(env.num_envs, -1)  # of each environment's episode; -1: it waits
        self.left, self.more = self._blocks(), True
        self.open: deque[_Block] = deque()  # ascending
        self.free = [place * _BLOCK for place in range(places)]  # a heap
        self.failed: list[dict[str, Any]] = []
        self.steps = np.zeros(len(_COUNTS), np.int64)
        self.episodes, self.taken, self.solved, self.total = 0, 0, 0, 0.0

    def play(self) -> None:
        env = self.env
        self._start(np.arange(env.num_envs))
        while (playing := np.flatnonzero(self.slot >= 0)).size:
            at = self.slot[playing], env.lengths[playing]
            self._keep(at, playing)
            actions = np.zeros((env.num_envs, self.width))
            actions[playing] = self._chosen(at, playing)
            self.actions[at] = np.clip(actions[playing], env._low, env._high)
            self.obs, reward, terminated, truncated, info = env.step(actions)
            self.rewards[at] = reward[playing]
            self.returns[at[0]] += reward[playing]
            ended = terminated | truncated
            if ended.any():
                self._end(np.flatnonzero(ended & (self.slot >= 0)), terminated, info)
                waits = (self.slot < 0) & self.more & bool(self.free)
                self._start(np.flatnonzero(ended | waits))

    def said(self) -> dict[str, Any]:
        """Counts of what was played; rates are over episodes that did not fail."""
        played = self.episodes - len(self.failed)
        return {
            "episodes": self.episodes,
            "rows": self.taken,
            "successes": self.solved,
            "success_rate": self.solved / played if played else None,
            "mean_return": self.total / played if played else None,
            "failed": self.failed,
            **dict(zip(_COUNTS, self.steps.tolist(), strict=True)),
        }

    def _blocks(self) -> Iterator[tuple[int, int]]:
        for first, end in self.writer.missing():
            for block in range(first, end, _BLOCK):
                yield block, min(_BLOCK, end - block)

    def _next(self) -> tuple[int, int] | None:
        """Slot and number of the next episode. None: all are begun, or no slot is free."""
        if not self.open or self.open[-1].begun == self.open[-1].count:
            found = next(self.left, None) if self.free else None
            self.more = found is not None or not self.free
            if found is None:
                return None
            self.open.append(_Block(*found, heapq.heappop(self.free)))
        block = self.open[-1]
        block.begun += 1
        return block.slot + block.begun - 1, block.first + block.begun - 1

    def _start(self, envs: Indices) -> None:
        """Begins the next episodes; an environment that waits repeats its last one."""
        env = self.env
        episodes = env.episodes[envs]
        for k, e in enumerate(envs):
            found = self._next()
            self.slot[e] = -1
            if found is not None:
                self.slot[e], episodes[k] = found
        env._start(envs, episodes)
        self.obs = env._observe()
        begun = envs[self.slot[envs] >= 0]
        self.returns[self.slot[begun]] = 0
        for k, values in enumerate(env.randomized().values()):
            self.randomized[self.slot[begun], k] = values[begun]
        if self.policy is None:
            for e in begun:
                draw = np.random.default_rng((env._seed, int(env.episodes[e]), 1)).uniform
                self.actions[self.slot[e]] = draw(env._low, env._high, (env.horizon, self.width))

    def _keep(self, at: tuple[Indices, Indices], envs: Indices) -> None:
        """Stores what is observed now in rows `at`."""
        batch = self.env._batch
        # Where the simulation has failed, a state may be out of float32's range. It is not written.
        state = {name: np.nan_to_num(singles(getattr(batch, name))) for name in _STATE}
        for key in _STATE:
            if key in self.obs and not np.array_equal(self.obs[key], state[key]):
                raise self.env._fault(
                    f"observe()[{key!r}] that is not batch.{key}, which data sets store",
                    "another name of the observation",
                )
        for key, rows in self.rows.items():
            rows[at] = self._part((state | self.obs)[key], envs)

    def _part(self, values: NDArray[Any], envs: Indices) -> NDArray[Any]:
        """Without a copy where it is the whole."""
        return values if len(envs) == self.env.num_envs else values[envs]

    def _chosen(self, at: tuple[Indices, Indices], envs: Indices) -> NDArray[np.float64]:
        """(n, na) of the environments that play."""
        if self.policy is None:
            return self.actions[at].astype(np.float64)
        env = self.env
        seen = {key: self._part(values, envs) for key, values in self.obs.items()}
        chosen = self.policy(seen, env.episodes[envs], env.lengths[envs])
        actions = np.asarray(numbers(chosen), np.float64)
        if actions.shape[:1] != (len(envs),) or actions.size != len(envs) * self.width:
            raise _core.InputError(
                f"actions of shape {actions.shape}; expected ({len(envs)}, {self.width})"
            )
        actions = actions.reshape(len(envs), self.width)
        if not np.isfinite(actions).all():
            row, k = np.argwhere(~np.isfinite(actions))[0]
            raise _core.InputError(
                f"the policy gives {actions[row, k]} as number {k} of action {at[1][row]} of "
                f"episode {env.episodes[envs[row]]}; expected a finite number"
            )
        return actions

    def _end(self, envs: Indices, terminated: NDArray[np.bool_], info: dict[str, Any]) -> None:
        """Stores the last states of episodes, and writes the blocks that they complete."""
        env, slots = self.env, self.slot[envs]
        self._keep((slots, env.lengths[envs]), envs)
        self.lengths[slots], self.terminated[slots] = env.lengths[envs], terminated[envs]
        self.success[slots] = info["success"][envs]
        counts, q, v = env._batch.counts(), env._batch.q, env._batch.v
        steps = np.stack([counts[name] for name in _COUNTS], 1)
        blocks = {block.slot: block for block in self.open}
        for e, slot in zip(envs, slots, strict=True):
            block = blocks[slot - slot % _BLOCK]
            block.ended += 1
            block.steps += steps[e]
            if info["status"][e] < 0:
                step = int(env.lengths[e] - 1) * env.steps_per_action
                state = q[e].tolist(), v[e].tolist()
                block.failures.append((int(env.episodes[e]), step, int(info["status"][e]), *state))
        self.slot[envs] = -1
        while self.open and self.open[0].ended == self.open[0].count:
            self._write(self.open.popleft())

    def _write(self, block: _Block) -> None:
        """Writes a whole block and frees its slots."""
        part = slice(block.slot, block.slot + block.count)
        block.failures.sort()
        self.writer.write(
            block.first, self.actions[part], [rows[part] for rows in self.rows.values()],
            self.rewards[part], self.randomized[part], self.lengths[part], self.returns[part],
            self.terminated[part], self.success[part], block.failures, block.steps.tolist(),
        )  # fmt: skip
        self.episodes += block.count
        self.steps += block.steps
        whole = np.ones(block.count, bool)
        for episode, step, status, _, _ in block.failures:
            whole[episode - block.first] = False
            reason = _core.StepStatus(status).name
            self.failed.append(
                {"episode": episode, "step": step, "status": status, "reason": reason}
            )
        self.taken += int(self.lengths[part][whole].sum())
        self.solved += int(self.success[part][whole].sum())
        self.total += float(self.returns[part][whole].sum())
        heapq.heappush(self.free, block.slot)
