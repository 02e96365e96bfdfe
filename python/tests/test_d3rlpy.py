# SPDX-License-Identifier: Apache-2.0
"""Data sets in d3rlpy: every row against the file, and a policy that is trained and played."""

from __future__ import annotations

import h5py
import numpy as np
import pytest

import tangere
from ball_rolling import BallRolling

d3rlpy = pytest.importorskip("d3rlpy", reason="d3rlpy is not installed")
from tangere import d3rlpy as ours  # noqa: E402


def test_rows_are_those_of_the_file(pushes, generate):
    buffer = ours.replay_buffer(pushes)
    assert len(buffer.episodes) == 20
    with h5py.File(pushes / "robomimic.hdf5") as file:
        demo = file["data/demo_3"]
        found = buffer.episodes[3]
        np.testing.assert_array_equal(found.actions, demo["actions"][()])
        np.testing.assert_array_equal(found.rewards[:, 0], demo["rewards"][()])
        assert found.terminated == bool(demo.attrs["terminated"])
        first = found.observations[0]
    env = tangere.make_vec("box_pushing", 20, flatten=True)
    obs, _ = env.reset(seed=5)
    np.testing.assert_allclose(first, obs[3], rtol=1e-6)
    grasps = ours.replay_buffer(generate("stable_grasp", "--episodes", "4"))
    assert all(episode.terminated for episode in grasps.episodes)
    with pytest.raises(tangere.InputError, match="keys \\['box'\\]; .* has \\['q', 'v', 'goal'"):
        ours.replay_buffer(pushes, keys=["box"])


def test_a_policy_is_trained_and_played(pushes, tmp_path):
    buffer = ours.replay_buffer(pushes, keys=["goal"], mask="train")
    algorithm = d3rlpy.algos.BCConfig(batch_size=64).create()
    algorithm.fit(buffer, n_steps=20, n_steps_per_epoch=20, show_progress=False,
                  logger_adapter=d3rlpy.logging.NoopAdapterFactory())  # fmt: skip
    found = ours.play(algorithm, "box_pushing", 5, keys=["goal"], num_envs=2)
    assert (found["episodes"], found["mean_actions"]) == (5, 100)
    with pytest.raises(tangere.InputError, match="keys \\['box'\\]"):
        ours.play(algorithm, "box_pushing", 5, keys=["box"])


def test_a_task_in_python_is_played():
    class Random:
        def predict(self, rows):
            self.width = rows.shape[1]
            return np.zeros((len(rows), 3), np.float32)

    algorithm = Random()
    found = ours.play(algorithm, BallRolling, 3, num_envs=2)
    assert (found["task"], found["episodes"], found["mean_actions"]) == ("BallRolling", 3, 8)
    assert algorithm.width == 3 + 2 + 32 * 32 * 3
    ours.play(algorithm, BallRolling, 1, keys=["goal"])
    assert algorithm.width == 2
    with pytest.raises(tangere.InputError, match="task 3; expected the name of a task, or a class"):
        ours.play(algorithm, 3)
