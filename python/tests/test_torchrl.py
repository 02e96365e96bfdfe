# SPDX-License-Identifier: Apache-2.0
"""torchrl's wrapper plays environments, many at once or one."""

from __future__ import annotations

import gymnasium
import numpy as np
import pytest

import tangere

pytest.importorskip("torchrl", reason="torchrl is not installed")
TASK = "tangere/StableGrasp-v0"  # episodes of one to nine actions


@pytest.mark.parametrize("flatten", [False, True])
def test_rows_are_those_of_the_environments(flatten):
    from torchrl.envs import GymWrapper

    arguments = {"threads": 1, "seed": 5, "flatten": flatten, "autoreset": "disabled"}
    made = gymnasium.make_vec(TASK, 4, **arguments)
    env = GymWrapper(made)
    key = "observation" if flatten else "flow"
    rows = env.reset()
    first = made.unwrapped._env.episodes()[0]  # the wrapper resets more often than it is told
    plain = tangere.make_vec("stable_grasp", 4, **arguments)
    obs, _ = plain.reset(options={"first_episode": int(first)})
    np.testing.assert_array_equal(rows[key], obs if flatten else obs[key])
    ends = 0
    for _ in range(12):
        rows["action"] = rows[key].new_zeros(4, 1)
        taken, rows = env.step_and_maybe_reset(rows)
        obs, reward, terminated, truncated, _ = plain.step(np.zeros((4, 1)))
        done = terminated | truncated
        np.testing.assert_allclose(taken["next", "reward"][:, 0], reward, rtol=1e-6)
        np.testing.assert_array_equal(taken["next", "done"][:, 0], done)
        np.testing.assert_array_equal(taken["next", key], obs if flatten else obs[key])
        if done.any():
            obs, _ = plain.reset(options={"reset_mask": done})
        np.testing.assert_array_equal(rows[key], obs if flatten else obs[key])
        ends += done.sum()
    assert ends > 4


def test_what_it_cannot_play_is_told():
    from torchrl.envs import GymWrapper

    with pytest.raises(RuntimeError, match="SAME_STEP or DISABLED"):
        GymWrapper(gymnasium.make_vec(TASK, 2, threads=1))


def test_one_environment_is_made_by_name():
    from torchrl.envs import GymEnv

    env = GymEnv(TASK, from_pixels=True, pixels_only=False)
    assert env.rollout(2, break_when_any_done=False)["pixels"].shape == (2, 384, 512, 3)
