# SPDX-License-Identifier: Apache-2.0
"""What vector environments of the catalogue's tasks and of tasks in Python share."""

from __future__ import annotations

from typing import Any, Literal

import numpy as np
from gymnasium.vector import AutoresetMode, VectorEnv

from . import _core

# KEY → array, or with `flatten` one array.
Observation = Any
Autoreset = Literal["next_step", "same_step", "disabled"]
AUTORESET = {
    "next_step": AutoresetMode.NEXT_STEP,
    "same_step": AutoresetMode.SAME_STEP,
    "disabled": AutoresetMode.DISABLED,
}


def system_seed() -> int:
    return int(np.random.default_rng().integers(2**63))


def checked_seed(seed: Any) -> int:
    if isinstance(seed, (list, tuple, np.ndarray)):
        raise _core.InputError(
            "one seed for each environment; expected one number, because an environment's "
            "episode already differs from the others' (docs/python.md)"
        )
    if not isinstance(seed, (int, np.integer)) or not 0 <= seed < 2**64:
        raise _core.InputError(f"seed {seed!r}; expected a whole number from 0 to 2^64 - 1")
    return int(seed)


def check_choices(num_envs: Any, autoreset: Any) -> None:
    """Raises InputError for arguments of a vector environment that are not among those known."""
    if not isinstance(num_envs, (int, np.integer)) or num_envs < 1:
        raise _core.InputError(f"num_envs {num_envs!r}; expected a whole number from 1 on")
    if autoreset not in AUTORESET:
        raise _core.InputError(f"autoreset {autoreset!r}; expected one of {sorted(AUTORESET)}")


def reset_options(
    seed: Any, options: dict[str, Any] | None
) -> tuple[np.ndarray | None, int | None]:
    """The mask (E) of environments to start and the first episode, from the options of a reset."""
    options = dict(options or {})
    mask = options.pop("reset_mask", None)
    first = options.pop("first_episode", None)
    if options:
        raise _core.InputError(f"options {list(options)}; known: reset_mask, first_episode")
    if mask is not None and (seed is not None or first is not None):
        raise _core.InputError("reset_mask goes with neither seed nor first_episode")
    return None if mask is None else np.asarray(mask, bool), None if first is None else int(first)


def final_info(last: Observation, final: dict[str, Any], ended: np.ndarray) -> dict[str, Any]:
    """What info has of the ends of episodes, besides that of the starts which follow at once."""
    obs = np.empty(len(ended), object)
    for e in np.flatnonzero(ended):
        obs[e] = {k: v[e] for k, v in last.items()} if isinstance(last, dict) else last[e]
    return {
        "final_info": final,
        "_final_info": ended,
        "final_obs": obs,
        "_final_obs": ended.copy(),
    }


class Remade:
    """Environments of which pickles and copies are made anew from the constructor's arguments.

    A copy plays no episode until its first reset. What was set besides the constructor is kept.
    """

    _arguments: dict[str, Any]
    _made: set[str]  # names of what the constructor sets

    def __getstate__(self) -> dict[str, Any]:
        kept = {key: value for key, value in self.__dict__.items() if key not in self._made}
        return {"arguments": self._arguments, "kept": kept}


class EpisodesEnv(Remade, VectorEnv):
    """Vector environments whose episodes are those of a seed, one after the other."""

    _seed: int
    _first_episode: int
    _fresh: bool  # made, and no episode has begun since

    def reset(
        self, *, seed: int | None = None, options: dict[str, Any] | None = None
    ) -> tuple[Observation, dict[str, Any]]:
        """Starts episodes: the first ones of `seed`, or without it the next ones.

        `options`: "reset_mask" (E) bool starts those alone; "first_episode" goes with a seed.
        """
        mask, first = reset_options(seed, options)
        if mask is not None:
            if mask.shape != (self.num_envs,):
                raise _core.InputError(
                    f"reset_mask of shape {mask.shape}; expected ({self.num_envs},)"
                )
            self._start_next(mask)
        elif seed is not None or first is not None:
            self._seed = self._seed if seed is None else checked_seed(seed)
            self._first_episode = self._first_episode if first is None else first
            self._start_all()
        elif not self._fresh:
            self._start_next(np.ones(self.num_envs, bool))
        self._fresh = False
        self._show()
        return self._observe(), self._info()

    def _start_all(self) -> None:
        raise NotImplementedError

    def _start_next(self, which: np.ndarray) -> None:
        raise NotImplementedError

    def _show(self) -> None:
        """Shows the environments if there is a window."""
        raise NotImplementedError

    def _observe(self) -> Observation:
        raise NotImplementedError

    def _info(self) -> dict[str, Any]:
        raise NotImplementedError
