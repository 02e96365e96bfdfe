# SPDX-License-Identifier: Apache-2.0
"""Stable-Baselines3 learns in environments whose numbers are those of `make_vec`."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

import tangere

pytest.importorskip("stable_baselines3", reason="Stable-Baselines3 is not installed")
sb3 = pytest.importorskip("tangere.sb3")


def test_steps_are_those_of_same_step_environments():
    env = sb3.VecEnv("stable_grasp", 5, threads=1, seed=2)
    plain = tangere.make_vec("stable_grasp", 5, threads=1, seed=2, autoreset="same_step")
    seen = env.reset()
    np.testing.assert_array_equal(seen["flow"], plain.reset()[0]["flow"])
    ends = 0
    for _ in range(12):
        action = plain.scripted_action()
        obs, reward, terminated, truncated, info = plain.step(action)
        seen, rewards, dones, infos = env.step(action)
        np.testing.assert_array_equal(seen["flow"], obs["flow"])
        np.testing.assert_array_equal(rewards, reward.astype(np.float32))
        np.testing.assert_array_equal(dones, terminated | truncated)
        for e in range(5):
            assert bool(infos[e]) == dones[e]
            if dones[e]:
                ends += 1
                last = infos[e]["terminal_observation"]["flow"]
                np.testing.assert_array_equal(last, info["final_obs"][e]["flow"])
                assert infos[e]["TimeLimit.truncated"] == truncated[e]
                assert infos[e]["is_success"] == info["final_info"]["success"][e]
                assert env.reset_infos[e]["episode_id"] == info["episode_id"][e]
    assert ends > 5


def test_seeds():
    env = sb3.VecEnv("box_pushing", 3, threads=1)
    assert env.seed(7) == [7, 7, 7]
    first = env.reset()["goal"]
    assert [info["episode_id"] for info in env.reset_infos] == [0, 1, 2]
    assert not np.array_equal(env.reset()["goal"], first)
    env.seed(7)
    np.testing.assert_array_equal(env.reset()["goal"], first)


def test_mistakes_are_told():
    env = sb3.VecEnv("box_pushing", 2, threads=1)
    for call, message in [
        (lambda: sb3.VecEnv("box_pushing", 2, autoreset="disabled"), "same_step alone"),
        (env.step_wait, "without step_async"),
        (lambda: env.env_method("state"), r"use .env.state"),
        (lambda: env.set_attr("x", 1), "attribute 'x'"),
        (lambda: env.seed(-1), "seed -1"),
    ]:
        with pytest.raises(tangere.InputError, match=message):
            call()
    assert env.get_attr("keys", [0]) == [["goal", "tactile"]]
    assert env.env_is_wrapped(object) == [False, False]


def test_ppo_learns():
    from stable_baselines3 import PPO
    from stable_baselines3.common.evaluation import evaluate_policy
    from stable_baselines3.common.vec_env import VecMonitor, VecNormalize

    env = VecNormalize(VecMonitor(sb3.VecEnv("box_pushing", 8, seed=1)), norm_obs=False)
    model = PPO("MultiInputPolicy", env, n_steps=104, batch_size=208, n_epochs=2, seed=0)
    before = [w.detach().clone() for w in model.policy.parameters()]
    model.learn(1664)
    assert model.num_timesteps == 1664
    assert any(not (a == b).all() for a, b in zip(before, model.policy.parameters(), strict=True))
    assert [info["l"] for info in model.ep_info_buffer] == [100] * 16
    flat = VecMonitor(sb3.VecEnv("box_pushing", 2, seed=1, flatten=True))
    mean, _ = evaluate_policy(PPO("MlpPolicy", flat, n_steps=10, batch_size=20), flat, 2)
    assert -1e4 < mean < 0


def test_the_example_learns_and_plays(monkeypatch, capsys):
    monkeypatch.syspath_prepend(str(Path(__file__).parents[2] / "examples"))
    import ppo

    rate = ppo.main(["--steps", "2048", "--episodes", "16"])
    assert 0 <= rate <= 1 and f"{rate:.3f} of 16 episodes solved" in capsys.readouterr().out


def test_gymnasiums_environments_are_made_by_name():
    from stable_baselines3.common.env_util import make_vec_env

    env = make_vec_env("tangere/BoxPushing-v0", n_envs=2, seed=1)
    goal = env.reset()["goal"]
    one = tangere.make_env("box_pushing")
    np.testing.assert_array_equal(goal, [one.reset(seed=s)[0]["goal"] for s in (1, 2)])
    assert [image.shape for image in env.get_images()] == [(384, 512, 3)] * 2


def test_pictures_are_those_of_the_environments():
    env = sb3.VecEnv("box_pushing", 2, threads=1, seed=1, render_mode="rgb_array")
    assert env.render_mode == "rgb_array"
    env.reset()
    np.testing.assert_array_equal(env.get_images(), env.env.render())
    assert env.render().shape == (768, 512, 3)  # one above the other
    assert sb3.VecEnv("box_pushing", 2).get_images() == [None, None]


def test_a_task_of_ones_own_is_stepped():
    class Bare(tangere.VectorSceneEnv):
        scene = tangere.scenes()["rolling_ball_small"]
        horizon = 3

        def reward(self, actions):
            return -self.batch.q[:, 2]

    env = sb3.VecEnv(Bare, 2, threads=1, seed=1)
    env.reset()
    ends = [env.step(np.full((2, 3), -0.1)) for _ in range(3)]
    assert [list(e[2]) for e in ends] == [[False] * 2, [False] * 2, [True] * 2]
    assert ends[2][3][0]["TimeLimit.truncated"] and set(ends[2][3][1]) >= {"terminal_observation"}
