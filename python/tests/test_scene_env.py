# SPDX-License-Identifier: Apache-2.0
"""Tasks of one's own: a twin of a task of the catalogue, Gymnasium's contract, episodes, faults."""

from __future__ import annotations

import importlib
import pickle
import warnings
from pathlib import Path

import gymnasium
import numpy as np
import pytest
from ball_rolling import BallRolling, uniform_actions
from gymnasium.utils.env_checker import check_env

import tangere


@pytest.fixture
def stable_grasp(monkeypatch):
    """The example, which needs PyTorch."""
    pytest.importorskip("torch", reason="PyTorch is not installed")
    monkeypatch.syspath_prepend(Path(__file__).parents[2] / "examples")
    return importlib.import_module("stable_grasp")


class Leaves(BallRolling):
    """Ends early where the ball is near its goal in x."""

    def terminated(self):
        return (abs(self.goal[:, 0] - self.batch.q[:, 3]) < 4e-3) & (self.lengths >= 3)


def test_episodes_count_from_zero():
    scene = tangere.Scene.from_string(
        '<tangere model="still"><robot><link name="a">'
        '<joint name="a" type="prismatic" axis="0 0 1"/>'
        '<body name="a" type="sphere" radius="1"/></link></robot></tangere>'
    )
    with pytest.raises(tangere.InputError, match="first_episode -1; expected 0 or more"):
        BallRolling(2, scene=scene, first_episode=-1)


def test_the_twin_of_a_task_has_its_numbers():
    twin = BallRolling(4, threads=1, seed=3)
    task = tangere.make_vec("ball_rolling_small", 4, threads=1, seed=3, normalise=False)
    twin.reset()
    seen = task.reset()[0]
    twin.goal[:] = task.state()[2]
    felt = 0
    for action in uniform_actions(7, 4):
        action[:, 2] = -0.3
        ours, theirs = twin.step(action), task.step(action)
        np.testing.assert_allclose(ours[1], theirs[1], rtol=1e-12)
        for key in seen:
            np.testing.assert_allclose(ours[0][key], theirs[0][key], rtol=1e-6, atol=1e-12)
        felt = max(felt, np.abs(ours[0]["tactile"]).max())
    assert felt > 0


@pytest.mark.parametrize("mode", ["next_step", "same_step"])
def test_the_twin_of_stable_grasp_has_its_numbers(mode, stable_grasp):
    """But for the densities, which each draws in its own way. Sums in another order differ by
    rounding: observations are float32, rewards up to 100."""
    task = tangere.make_vec("stable_grasp", 5, threads=1, seed=3, autoreset=mode)

    class Twin(stable_grasp.StableGrasp):
        def densities(self, envs):
            drawn = task.randomized()
            return np.stack([drawn[name][envs] for name in stable_grasp.DENSITIES], 1)

    first = task.reset()[0]
    twin = Twin(5, threads=1, seed=3, autoreset=mode)
    np.testing.assert_allclose(twin.reset()[0]["flow"], first["flow"], atol=1e-6)
    solved, begun = 0, 0
    for t in range(14):
        action = np.random.default_rng(t).uniform(-0.3, 0.3, (5, 1))
        action[::2] = task.scripted_action()[::2]
        theirs, ours = task.step(action), twin.step(action)
        np.testing.assert_allclose(ours[0]["flow"], theirs[0]["flow"], atol=1e-6)
        np.testing.assert_allclose(ours[1], theirs[1], atol=1e-11)
        for k in (2, 3):
            np.testing.assert_array_equal(ours[k], theirs[k])
        for key in ("success", "starting", "episode_id", "status"):
            np.testing.assert_array_equal(ours[4][key], theirs[4][key])
        np.testing.assert_allclose(twin.batch.q, task.state()[0], atol=1e-11)
        solved += int(ours[2].sum())
        begun += int((twin.episodes >= 5).sum())
    assert solved > 3 and begun > 0


def test_drawn_bars_balance_at_a_drawn_place(stable_grasp):
    env = stable_grasp.StableGrasp(40, threads=1, seed=5)
    blocks = np.stack([env.randomized()[name] for name in stable_grasp.DENSITIES], 1)
    place = (blocks * (np.arange(11) + 0.5)).sum(1) / blocks.sum(1)  # from the right end [blocks]
    assert (blocks > 0).all()
    for e in range(40):
        one = np.random.default_rng((5, e)).uniform([1, 600, 3000], [10, 700, 7000])
        assert place[e] == pytest.approx(one[0]) and blocks[e].sum() == pytest.approx(one[2])
        assert blocks[e, int(one[0])] == pytest.approx(one[1])


def test_gymnasiums_checker_passes():
    tangere.register_scene_env("TestRolling-v0", BallRolling, seed=5)
    env = gymnasium.make("TestRolling-v0")
    with warnings.catch_warnings():
        warnings.filterwarnings("ignore", message=".*Box observation space m.*imum value is")
        check_env(env.unwrapped, skip_render_check=True)
    assert env.spec.max_episode_steps == 8
    many = gymnasium.make_vec("TestRolling-v0", 3)
    assert isinstance(many, BallRolling) and many.num_envs == 3
    with pytest.raises(tangere.InputError, match="max_episode_steps 9; the horizon of BallR"):
        gymnasium.make_vec("TestRolling-v0", 3, max_episode_steps=9)


def episodes(envs, mode, count):
    """Episode → its starting goal, observations after every action, rewards and last end."""
    env = Leaves(envs, threads=1, seed=2, autoreset=mode)
    obs, info = env.reset()
    found = {int(e): [obs["goal"][k]] for k, e in enumerate(info["episode_id"])}
    done = set()
    while not set(range(count)) <= done:
        # The action of a state, so that it does not depend on the environment.
        now = env.goal - env.batch.q[:, 3:5]
        step = env.step(np.concatenate([2 * now, np.full((envs, 1), -0.2)], 1))
        obs, reward, terminated, truncated, info = step
        mask = np.zeros(envs, bool)
        for k, e in enumerate(info["episode_id"]):
            ended = bool(terminated[k] or truncated[k])
            if mode == "same_step" and ended:
                last = int(info["final_info"]["episode_id"][k])
                found[last] += [info["final_obs"][k]["goal"], reward[k], bool(terminated[k])]
                done.add(last)
                found[int(e)] = [obs["goal"][k]]
            elif int(e) not in found:  # "next_step": the start is shown in place of a step
                assert info["starting"][k] and reward[k] == 0 and not ended
                found[int(e)] = [obs["goal"][k]]
            else:
                found[int(e)] += [obs["goal"][k], reward[k]]
                if ended:
                    found[int(e)].append(bool(terminated[k]))
                    done.add(int(e))
                    mask[k] = True
        if mode == "disabled" and mask.any():
            obs, info = env.reset(options={"reset_mask": mask})
            for k in np.flatnonzero(mask):
                found[int(info["episode_id"][k])] = [obs["goal"][k]]
    return [found[e] for e in range(count)]


def test_episodes_depend_on_neither_environments_nor_mode():
    reference = episodes(5, "next_step", 10)
    ends = [episode[-1] for episode in reference]
    assert True in ends and False in ends  # some leave, some run out of time
    assert {len(e) for e in reference if e[-1]} == {8} and len(reference[ends.index(False)]) == 18
    cases = ((2, "next_step"), (3, "same_step"), (4, "disabled"), (1, "same_step"))
    for envs, mode in cases:
        for ours, theirs in zip(episodes(envs, mode, 10), reference, strict=True):
            for a, b in zip(ours, theirs, strict=True):
                np.testing.assert_array_equal(a, b)


def test_an_environment_without_autoreset_stands_still_after_its_end():
    env = Leaves(5, threads=1, seed=2, autoreset="disabled")
    env.reset()
    ends = np.zeros((2, 5), bool)
    for _ in range(8):
        q, over = env.batch.q, ends.any(0)
        before = ends.copy()
        obs, reward, *flags, info = env.step([0.1, 0, -0.2])
        ends = np.array(flags)
        np.testing.assert_array_equal(env.batch.q[over], q[over])
        assert (env.batch.q[~over] != q[~over]).any(1).all()
        np.testing.assert_array_equal(ends[:, over], before[:, over])
        assert not reward[over].any() and (env.lengths[~over] == env.lengths.max()).all()
    assert ends.any(0).all() and 3 <= env.lengths.min() < env.lengths.max() == 8


def test_a_reset_starts_the_first_or_the_next_episodes():
    env = BallRolling(3, threads=1, seed=4)
    first = env.reset()[0]["goal"]
    again, info = env.reset()
    assert list(info["episode_id"]) == [3, 4, 5] and not np.array_equal(first, again["goal"])
    np.testing.assert_array_equal(env.reset(seed=4)[0]["goal"], first)
    later = env.reset(seed=4, options={"first_episode": 3})[0]
    np.testing.assert_array_equal(later["goal"], again["goal"])
    assert len(np.unique(first)) == 6  # x and y, and environments, have draws of their own


def test_a_copy_is_made_anew():
    env = BallRolling(2, threads=1, seed=7)
    copied = pickle.loads(pickle.dumps(env))
    np.testing.assert_array_equal(copied.reset()[0]["tactile"], env.reset()[0]["tactile"])
    step, other = (e.step([0.1, 0, -0.3]) for e in (env, copied))
    np.testing.assert_array_equal(step[1], other[1])


def test_pictures_and_flat_observations():
    env = BallRolling(2, threads=1, seed=1, flatten=True, render_mode="rgb_array")
    obs, _ = env.reset()
    assert obs.shape == env.observation_space.shape == (2, 5 + 32 * 32 * 3)
    pictures = env.render()
    assert len(pictures) == 2 and pictures[0].shape == (384, 512, 3) and pictures[0].std() > 0
    single = tangere.SceneEnv(BallRolling, seed=1, flatten=True, render_mode="rgb_array")
    np.testing.assert_array_equal(single.reset()[0], obs[0])
    np.testing.assert_array_equal(single.render(), pictures[0])


def test_defaults_are_the_state_and_the_sums_of_sensors():
    class Bare(tangere.VectorSceneEnv):
        scene = tangere.scenes()["rolling_ball_small"]

        def reward(self, actions):
            return np.zeros(self.num_envs)

    env = Bare(2, threads=1)
    assert list(env.reset()[0]) == ["q", "v", "pad"] and env.single_action_space.shape == (3,)
    assert not env.step([0, 0, 0])[2].any()


class FailsAt(BallRolling):
    def controls(self, actions):
        return np.where(self.lengths[:, None] >= 2, np.nan, actions)


def test_a_failed_simulation_is_truncated_and_goes_on_with_the_next_episode():
    env = FailsAt(2, threads=1, seed=1)
    env.reset()
    ends = [env.step([0, 0, -0.1]) for _ in range(4)]
    assert [bool(e[3].all()) for e in ends] == [False, False, True, False]
    assert (ends[2][4]["status"] < 0).all() and np.isfinite(ends[2][1]).all()
    assert (ends[3][4]["status"] >= 0).all() and list(ends[3][4]["episode_id"]) == [2, 3]


def with_(**members):
    return type("Mine", (BallRolling,), members)


@pytest.mark.parametrize(
    ("members", "message"),
    [
        ({"scene": None}, "Mine: no scene; expected a class attribute `scene`"),
        ({"horizon": 0}, "Mine: horizon 0; expected a whole number from 1 on"),
        ({"actions": 0}, "Mine: actions 0; expected a whole number from 1 on"),
        ({"actions": -1}, "Mine: actions -1; expected a whole number from 1 on"),
        ({"actions": 2.0}, "Mine: actions 2.0; expected a whole number from 1 on"),
        ({"action_low": (-1, -2)}, "Mine: 2 and 1 bounds of actions; expected 1 or 3"),
        ({"observe": lambda s: {"q": s.batch.q[0]}}, r"\['q'\] of shape \(5|8|10,\); expected"),
        ({"action_low": 1, "action_high": -1}, "action_low 1 and action_high -1; expected the"),
        ({"observe": lambda s: s.batch.q}, r"Mine: observe\(\) ndarray; expected a dict"),
        ({"observe": lambda s: {"x": np.full((2, 1), np.nan)}}, r"observe\(\)\['x'\] with numbers"),
        ({"reward": lambda s, a: 0.0}, r"Mine: reward\(\) of shape \(\); expected \(2,\)"),
        ({"reward": lambda s, a: np.full(2, np.nan)}, r"reward\(\) nan in environment 0; expec"),
        ({"terminated": lambda s: [True]}, r"Mine: terminated\(\) of shape \(1,\); expected"),
        (
            {"terminated": lambda s: np.array([0.0, 0.3])},
            r"Mine: terminated\(\) of float64, 0.3 in environment 1; expected bool",
        ),
        (
            {"success": lambda s: 2 * s.episodes},
            r"Mine: success\(\) of int64, 2 in environment 1; expected bool",
        ),
        ({"controls": lambda s, a: a[:, :2]}, r"controls\(\) of shape \(2, 2\); expected \(2, 3\)"),
    ],
)
def test_faults_name_the_class_the_value_and_what_was_expected(members, message):
    with pytest.raises(tangere.InputError, match=message):
        env = with_(**members)(2, threads=1)
        env.reset()
        env.step(np.zeros(3))


def test_other_faults():
    env = BallRolling(2, threads=1)
    with pytest.raises(tangere.InputError, match=r"actions of shape \(4,\); expected \(2, 3\) or"):
        env.step(np.zeros(4))
    with pytest.raises(tangere.InputError, match=r"reset_mask of shape \(3,\); expected \(2,\)"):
        env.reset(options={"reset_mask": [True] * 3})
    with pytest.raises(tangere.InputError, match="options .'x'.; known: reset_mask"):
        env.reset(options={"x": 1})
    with pytest.raises(tangere.InputError, match="num_envs 0"):
        BallRolling(0)
