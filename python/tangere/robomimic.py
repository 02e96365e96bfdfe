# SPDX-License-Identifier: Apache-2.0
"""Tasks as environments of robomimic, so that policies that it trained can be played.

    python -m tangere.robomimic model.pth --episodes 300

Needs robomimic and PyTorch. `import tangere.robomimic` registers `EnvTangere`: from then on
robomimic makes it wherever a file or a checkpoint names an environment "tangere/…", as those of
`tangere generate` do. All other names go where they went before.
"""

from __future__ import annotations

import argparse
import json
import sys
from copy import deepcopy
from typing import Any, NoReturn, Sequence

import numpy as np
import robomimic.utils.env_utils as env_utils
from robomimic.envs.env_base import EnvBase, EnvType

from . import _core
from ._closed_loop import TEST_SEED, success_summary
from .gym import TaskEnv, gym_id


class EnvTangere(EnvBase):  # type: ignore[misc]
    """One environment of a task with robomimic's interface.

    Observations have the keys, units and shapes of `obs` in the files of `tangere generate`: what
    the task shows, in SI units, and q and v. A policy takes those that its configuration names.
    `reset` starts one episode after the other; `is_success` has the key "task".

    Parameters
    ----------
    env_name: the Gymnasium id of the task, such as "tangere/BoxPushing-v0".
    task: its name, as `env_kwargs` of a file have it. None: the one that env_name names.
    seed, first_episode: of the first episode. None: a seed from the system.
    readings: of sensors, windows among them, as `env_kwargs` of a file have them.
    render, render_offscreen, use_image_obs, use_depth_obs: must be False, because there are
        no pictures.
    postprocess_visual_obs, lang: have no meaning here.
    """

    def __init__(
        self,
        env_name: str,
        render: bool = False,
        render_offscreen: bool = False,
        use_image_obs: bool = False,
        postprocess_visual_obs: bool = True,
        *,
        task: str | None = None,
        seed: int | None = None,
        first_episode: int = 0,
        readings: Sequence[str] = (),
        use_depth_obs: bool = False,
        lang: Any = None,
    ):
        if render or render_offscreen or use_image_obs or use_depth_obs:
            raise _core.InputError(
                f"{env_name} has no pictures; expected no rendering (in a configuration, "
                "experiment.render_video false)"
            )
        ids = {gym_id(name): name for name in _core.task_names()}
        if env_name not in ids or task not in (None, ids[env_name]):
            raise _core.InputError(
                f"environment {env_name!r} with task {task!r}; expected one of {sorted(ids)} and "
                "its task"
            )
        self._id = env_name
        self._task = ids[env_name]
        self._given: dict[str, Any] = {"task": self._task}
        if readings:
            self._given["readings"] = [*readings]
        self._env = TaskEnv(
            self._task, seed=seed, first_episode=first_episode, readings=readings, normalise=False
        )
        self._observation: dict[str, np.ndarray] = {}
        self._reward, self._done, self._success = 0.0, False, False
        self._actions: list[np.ndarray] = []
        self._seed, self._episode = seed, first_episode
        self._started = False

    @property
    def env(self) -> TaskEnv:
        """The environment of `tangere.gym` underneath."""
        return self._env

    @property
    def horizon(self) -> int:
        """Actions after which an episode ends at the latest."""
        return int(self._env.task.horizon)

    def reset(
        self, *, seed: int | None = None, first_episode: int | None = None
    ) -> dict[str, np.ndarray]:
        """Starts the next episode, or with a seed the first one of that seed.

        Returns the observation, as `step` does.
        """
        if seed is None and not self._started:
            seed = self._seed
        if seed is not None:
            self._seed = seed
        options = None if first_episode is None else {"first_episode": first_episode}
        seen, info = self._env.reset(seed=seed, options=options)
        self._started = True
        self._episode = info["episode_id"]
        self._actions = []
        return self._take(seen, 0.0, False, info["success"])

    def step(self, action: Any) -> tuple[dict[str, np.ndarray], float, bool, dict[str, Any]]:
        """Takes an action (na) in [-1, 1]. Returns observation, reward, done and info."""
        action = np.array(action, np.float64)
        seen, reward, terminated, truncated, info = self._env.step(action)
        self._actions.append(action)
        self._take(seen, reward, terminated or truncated, info["success"])
        return self.get_observation(), reward, self._done, info

    def _take(
        self, seen: dict[str, np.ndarray], reward: float, done: bool, success: bool
    ) -> dict[str, np.ndarray]:
        q, v, _ = self._env.state()
        self._observation = {"q": q.astype(np.float32), "v": v.astype(np.float32), **seen}
        self._reward, self._done, self._success = reward, done, success
        return self.get_observation()

    def get_observation(self) -> dict[str, np.ndarray]:
        """The present observation: KEY → float32 array."""
        return {key: value.copy() for key, value in self._observation.items()}

    def get_state(self) -> dict[str, Any]:
        """The way to the present state: seed, episode and the actions so far, (n, na).

        An episode is the same every time, so `reset_to` comes to the same bits.
        """
        if self._seed is None:
            raise _core.InputError("get_state() of an environment without a seed; give it one")
        actions = np.asarray(self._actions).reshape(len(self._actions), self.action_dimension)
        return {"seed": self._seed, "episode": self._episode, "actions": actions}

    def reset_to(self, state: dict[str, Any]) -> dict[str, np.ndarray]:
        """Plays the episode of `get_state` anew up to its state, and returns the observation."""
        self.reset(seed=int(state["seed"]), first_episode=int(state["episode"]))
        for action in state["actions"]:
            self.step(action)
        return self.get_observation()

    def get_reward(self) -> float:
        """The reward of the last action."""
        return self._reward

    def is_done(self) -> bool:
        """Whether the episode is over."""
        return self._done

    def is_success(self) -> dict[str, bool]:
        """{"task": whether the task is solved now}."""
        return {"task": bool(self._success)}

    def render(self, *arguments: Any, **named: Any) -> NoReturn:
        """Always raises InputError: there are no pictures. See `tangere plot`."""
        raise _core.InputError("there are no pictures of an environment; see `tangere plot`")

    def get_goal(self) -> NoReturn:
        """Always raises NotImplementedError: a goal is part of the observation."""
        raise NotImplementedError("a goal is part of the observation of a task")

    def set_goal(self, **named: Any) -> NoReturn:
        """Always raises NotImplementedError: a goal is drawn for each episode."""
        raise NotImplementedError("the goal of a task is drawn for each episode")

    @property
    def action_dimension(self) -> int:
        """na."""
        return int(np.prod(self._env.task.action.shape))

    @property
    def name(self) -> str:
        """Such as "BoxPushing-v0". robomimic makes names of files of it, so it has no slash."""
        return self._id.partition("/")[2]

    @property
    def type(self) -> int:
        """robomimic's number for Gym environments, as in `env_args` of a file."""
        return int(EnvType.GYM_TYPE)

    @property
    def version(self) -> str:
        """The version of Tangere, which a file names as `env_version`."""
        return str(getattr(_core, "__version__"))

    def serialize(self) -> dict[str, Any]:
        """`env_args`, from which robomimic makes the environment again."""
        return {
            "env_name": self._id,
            "type": self.type,
            "env_kwargs": deepcopy(self._given),
            "env_version": self.version,
        }

    @classmethod
    def create_for_data_processing(
        cls, env_name: str, camera_names: Sequence[str] = (), camera_height: Any = None,
        camera_width: Any = None, reward_shaping: Any = None, **named: Any,
    ) -> EnvTangere:  # fmt: skip
        """An environment as from the constructor. Rewards are those of the task in any case."""
        if camera_names:
            raise _core.InputError(f"{env_name} has no cameras; expected no camera_names")
        return cls(env_name, **named)

    @property
    def base_env(self) -> TaskEnv:
        """The same as `env`, by the name that later versions of robomimic use."""
        return self._env

    @property
    def rollout_exceptions(self) -> tuple[Any, ...]:
        """None: an episode whose simulation fails ends without success."""
        return ()

    def __repr__(self) -> str:
        return f"{self._id}\n{json.dumps(self._given, sort_keys=True)}"


class _ByName:
    """What robomimic calls in place of its class for Gym: chooses by the environment's name."""

    others: Any = None  # robomimic's own get_env_class

    @classmethod
    def _class_of(cls, env_name: str) -> Any:
        if str(env_name).startswith("tangere/"):
            return EnvTangere
        return cls.others(env_type=EnvType.GYM_TYPE)

    def __new__(cls, env_name: str, *args: Any, **kwargs: Any) -> Any:
        return cls._class_of(env_name)(env_name, *args, **kwargs)

    @classmethod
    def create_for_data_processing(cls, env_name: str, *args: Any, **kwargs: Any) -> Any:
        return cls._class_of(env_name).create_for_data_processing(env_name, *args, **kwargs)


def register() -> None:
    """Makes robomimic find `EnvTangere`. `import tangere.robomimic` has done it."""
    if _ByName.others is not None:
        return
    _ByName.others = env_utils.get_env_class

    def get_env_class(env_meta: Any = None, env_type: Any = None, env: Any = None) -> Any:
        if isinstance(env, EnvTangere):
            return EnvTangere
        kind = env_utils.get_env_type(env_meta=env_meta, env_type=env_type, env=env)
        if kind != EnvType.GYM_TYPE:
            return _ByName.others(env_type=kind)
        return _ByName if env_meta is None else _ByName._class_of(env_meta["env_name"])

    env_utils.get_env_class = get_env_class


register()


def evaluate(
    model: str, episodes: int = 300, seed: int = TEST_SEED, first_episode: int = 0
) -> dict[str, Any]:
    """Plays a checkpoint of robomimic in closed loop.

    Returns "task", "episodes", "successes", "success_rate", the bounds of its 95 % interval after
    Wilson in "interval", "mean_return" and "mean_actions".
    """
    import robomimic.utils.file_utils as file_utils
    from robomimic.utils.train_utils import run_rollout

    if episodes < 1:
        raise _core.InputError(f"{episodes} episodes; expected at least 1")
    try:
        policy, checkpoint = file_utils.policy_from_checkpoint(ckpt_path=str(model))
    except OSError:
        raise
    except Exception as error:  # whatever unpickling and building a network may meet
        raise _core.InputError(
            f"{model}: {error!r}; expected a checkpoint of robomimic"
        ) from error
    meta = checkpoint["env_metadata"]
    if not str(meta["env_name"]).startswith("tangere/"):
        raise _core.InputError(
            f"{model} was trained for {meta['env_name']!r}; expected an environment tangere/…"
        )
    env = EnvTangere(
        meta["env_name"], seed=seed, first_episode=first_episode, **meta["env_kwargs"]
    )
    played = [run_rollout(policy, env, env.horizon) for _ in range(episodes)]
    solved, returns, actions = (
        [run[name] for run in played] for name in ("Success_Rate", "Return", "Horizon")
    )
    found = {"task": env.serialize()["env_kwargs"]["task"], "seed": seed}
    return found | success_summary(solved, returns, actions)


def main(arguments: Sequence[str] | None = None) -> int:
    """The command; returns its exit code: 0 done, 2 usage or model, 3 the file cannot be read."""
    parser = argparse.ArgumentParser(
        prog="python -m tangere.robomimic",
        description="Play a policy that robomimic has trained from a data set of tangere generate.",
    )
    parser.add_argument("model", metavar="MODEL.pth", help="checkpoint of robomimic")
    parser.add_argument("--episodes", type=int, default=300, metavar="N", help="[default: 300]")
    parser.add_argument(
        "--seed", type=int, default=TEST_SEED, metavar="N",
        help=f"of the episodes; not that of the data set [default: {TEST_SEED}]",
    )  # fmt: skip
    parser.add_argument("--json", action="store_true", help="print one JSON object")
    given = parser.parse_args(arguments)
    try:
        found = evaluate(given.model, given.episodes, given.seed)
    except _core.InputError as error:
        print(f"tangere.robomimic: {error}", file=sys.stderr)
        return 2
    except OSError as error:
        print(f"tangere.robomimic: {error}", file=sys.stderr)
        return 3
    if given.json:
        print(json.dumps(found))
        return 0
    print(
        f"{found['task']}: {found['successes']} of {found['episodes']} episodes solved, "
        f"{found['success_rate']:.3f} (95 %: {found['interval'][0]:.3f} to "
        f"{found['interval'][1]:.3f}); mean return {found['mean_return']:.4g}, "
        f"{found['mean_actions']:.1f} actions"
    )
    return 0


if __name__ == "__main__":
    # As the module that `import tangere.robomimic` gives, so that there is one class EnvTangere.
    from tangere import robomimic as module

    sys.exit(module.main())
