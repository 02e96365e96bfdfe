# SPDX-License-Identifier: Apache-2.0
"""Gymnasium's contract, for one environment and for many."""

from __future__ import annotations

import copy
import functools
import pickle
import warnings
from pathlib import Path

import gymnasium
import h5py
import numpy as np
import pytest
from gymnasium.envs.registration import EnvSpec
from gymnasium.utils.env_checker import check_env
from gymnasium.vector import AutoresetMode

import tangere
from tangere.gym import env_spec_json

SHORT = "stable_grasp"  # episodes of one to nine actions


def same(a, b):
    if isinstance(a, dict):
        assert a.keys() == b.keys()
        for key in a:
            same(a[key], b[key])
    else:
        np.testing.assert_array_equal(a, b)


@pytest.mark.parametrize("task", tangere.task_names())
def test_every_task_passes_gymnasiums_checker(task):
    if task == "ball_rolling":
        pytest.skip("ball_rolling_small is the same task with fewer points")
    env = gymnasium.make(tangere.gym_id(task))
    with warnings.catch_warnings():
        warnings.filterwarnings("ignore", message=".*Box observation space m.*imum value is")
        warnings.filterwarnings("ignore", message=".*action space.*not.*-1.*1")
        check_env(env.unwrapped, skip_render_check=True)


def test_ids_are_registered():
    assert tangere.gym_id("box_pushing_privileged") == "tangere/BoxPushingPrivileged-v0"
    for task in tangere.task_names():
        assert tangere.gym_id(task) in gymnasium.registry
    vector = gymnasium.make_vec("tangere/BoxPushing-v0", 3, threads=1)
    assert isinstance(vector, tangere.VectorTaskEnv) and vector.num_envs == 3


def test_a_spec_in_a_file_makes_the_environment():
    env = gymnasium.make(EnvSpec.from_json(env_spec_json("box_pushing", normalise=False)))
    assert isinstance(env.unwrapped, tangere.TaskEnv)
    assert env.unwrapped.task.name == "box_pushing" and env.spec.max_episode_steps == 100


def test_the_limit_of_steps_is_the_horizon():
    for task in tangere.task_names():
        horizon = tangere.task_spec(task).horizon
        assert gymnasium.spec(tangere.gym_id(task)).max_episode_steps == horizon
    env = gymnasium.make("tangere/BoxPushing-v0")
    env.reset(seed=0)
    ends = [env.step(np.zeros(3))[2:4] for _ in range(env.spec.max_episode_steps)]
    assert ends == [(False, False)] * 99 + [(False, True)]
    vector = gymnasium.make_vec("tangere/BoxPushing-v0", 2, threads=1)
    assert vector.spec.max_episode_steps == 100
    with pytest.raises(tangere.InputError, match="max_episode_steps 7; the horizon of task 'box_"):
        gymnasium.make_vec("tangere/BoxPushing-v0", 2, max_episode_steps=7)


def unpickled(env):
    return pickle.loads(pickle.dumps(env))


@pytest.mark.parametrize("copied", [unpickled, copy.deepcopy])
def test_a_copy_is_made_anew(copied):
    arguments = {"seed": 3, "first_episode": 2, "normalise": False, "keys": ["goal"]}
    one, many = tangere.make_env("box_pushing", **arguments), tangere.make_vec(
        "box_pushing", 2, threads=1, autoreset="same_step", **arguments
    )
    for env in (one, many, gymnasium.make("tangere/BoxPushing-v0", **arguments)):
        twin = copied(env)
        first, again = env.reset(), twin.reset()
        same(first[0], again[0])
        same(first[1], again[1])
        assert twin.observation_space == env.observation_space and "tactile" not in again[0]
        env.step(env.action_space.sample())
        later = copied(env)  # it plays no episode yet
        same(later.reset()[0], first[0])
    assert twin.spec.id == "tangere/BoxPushing-v0" and twin.unwrapped.spec.kwargs["seed"] == 3
    assert copied(many).autoreset_mode is AutoresetMode.SAME_STEP
    with pytest.raises(tangere.InputError, match="call reset"):
        copied(one).step(np.zeros(3))


class Scored(tangere.TaskEnv):
    def __init__(self, weight):
        self.before = weight
        super().__init__("box_pushing", seed=1, keys=["goal"])
        self.weight = weight


def test_a_class_of_ones_own_is_copied_too():
    env = Scored(2.5)
    twin = unpickled(env)
    assert isinstance(twin, Scored) and twin.weight == twin.before == 2.5
    same(twin.reset()[0], env.reset()[0])


def test_a_scene_is_copied_with_its_file(tmp_path):
    text = tangere.gym.task_scene("dummy").text
    path = tmp_path / "scene.xml"
    path.write_text(text, encoding="utf-8")
    read, written = tangere.Scene(path), tangere.Scene.from_string(text, "own")
    assert unpickled(read).path == str(path) and unpickled(read).text == text
    assert copy.deepcopy(written).text == text and unpickled(written).path == "own"
    env = unpickled(tangere.make_env("dummy", scene=written))
    assert env.model.scene.text == text
    kept = pickle.dumps(read)
    path.write_text(text.replace("kt", "kt ", 1), encoding="utf-8")
    with pytest.raises(tangere.InputError, match="scene.xml: the file is not as it was"):
        pickle.loads(kept)


def test_processes_of_their_own_play_environments():
    make = functools.partial(copy.deepcopy, tangere.make_env("box_pushing", keys=["goal"]))
    env = gymnasium.vector.AsyncVectorEnv([make, make], context="spawn")
    try:
        goal = env.reset(seed=[5, 6])[0]["goal"]
    finally:
        env.close()
    expected = [tangere.make_env("box_pushing").reset(seed=s)[0]["goal"] for s in (5, 6)]
    np.testing.assert_array_equal(goal, expected)


def test_randomized_numbers_are_those_of_a_data_set(generate):
    folder = generate("stable_grasp", "--episodes", "3", "--seed", "4")
    env = tangere.make_vec("stable_grasp", 3, threads=1)
    env.reset(seed=4)
    drawn = env.randomized()
    one = tangere.make_env("stable_grasp")
    one.reset(seed=4)
    assert one.randomized() == {name: values[0] for name, values in drawn.items()}
    with h5py.File(folder / "shard-00000.h5") as file:
        names = list(file["scene"].attrs["randomized_names"])
        assert names == list(drawn) and "body block_3 density" in names
        for e in range(3):
            stored = file[f"data/demo_{e}"].attrs["randomized"]
            np.testing.assert_array_equal(stored, [values[e] for values in drawn.values()])
    assert tangere.make_env("box_pushing").randomized() == {}


def test_spaces_hold_what_comes():
    for flatten in (False, True):
        env = tangere.make_vec("cap_opening", 5, threads=1, flatten=flatten)
        obs, _ = env.reset(seed=1)
        for _ in range(3):
            assert env.observation_space.contains(obs)
            actions = env.action_space.sample()
            assert env.action_space.contains(actions)
            obs, reward, terminated, truncated, info = env.step(actions)
            assert reward.dtype == np.float64 and terminated.dtype == truncated.dtype == bool
            assert info["status"].dtype == np.int8 and info["episode_id"].dtype == np.int64
            assert set(info) == {p + k for k in ("success", "starting", "episode_id", "status")
                                 for p in ("", "_")}  # fmt: skip


def test_observations_are_divided_by_their_scales():
    scaled, plain = (tangere.make_vec("box_pushing", 3, normalise=n) for n in (True, False))
    one, si = scaled.reset(seed=2)[0], plain.reset(seed=2)[0]
    for _ in range(20):
        action = plain.scripted_action()
        one, si = scaled.step(action)[0], plain.step(action)[0]
    assert scaled.observation_scale == {"goal": [0.1, 0.1, 0.3], "tactile": [0.01, 0.01, 0.02]}
    for key, by in scaled.observation_scale.items():
        np.testing.assert_allclose(one[key] * np.float32(by), si[key], rtol=1e-6)
    assert np.abs(si["tactile"]).max() > 0
    flat = tangere.make_vec("box_pushing", 3, flatten=True, keys=["goal"])
    np.testing.assert_array_equal(flat.reset(seed=2)[0], scaled.reset(seed=2)[0]["goal"])


def test_an_episode_hangs_on_neither_count_nor_threads():
    runs = []
    for envs, threads in ((1, 1), (18, 1), (18, 2)):
        env = tangere.make_vec("box_pushing", envs, threads=threads)
        seen = [env.reset(seed=9)[0]]
        for t in range(5):
            seen.append(env.step(np.full((envs, 3), 0.1 * t, np.float32))[0])
        runs.append([{k: v[0] for k, v in obs.items()} for obs in seen])
    for other in runs[1:]:
        for a, b in zip(runs[0], other, strict=True):
            same(a, b)


def test_seeds_name_episodes():
    env = tangere.make_vec("box_pushing", 2, threads=1)
    first = env.reset(seed=3)[0]
    assert env.reset()[1]["episode_id"].tolist() == [2, 3]
    other = env.reset(seed=4)[0]
    assert not np.array_equal(first["goal"], other["goal"])
    same(env.reset(seed=3)[0], first)
    again, info = env.reset(seed=3, options={"first_episode": 1})
    np.testing.assert_array_equal(again["goal"][0], first["goal"][1])
    assert info["episode_id"].tolist() == [1, 2]
    fresh = tangere.make_vec("box_pushing", 2, seed=3)
    same(fresh.reset()[0], first)
    one = gymnasium.make("tangere/BoxPushing-v0")
    np.testing.assert_array_equal(one.reset(seed=3)[0]["goal"], first["goal"][0])
    with pytest.raises(tangere.InputError, match="one number"):
        env.reset(seed=[1, 2])
    for wrong in (-3, 2**64, 1.7):
        with pytest.raises(tangere.InputError, match="whole number"):
            env.reset(seed=wrong)


def test_without_a_seed_no_two_are_alike():
    goals = [tangere.make_env("box_pushing_reduced").reset()[0]["goal"].tolist() for _ in range(3)]
    assert goals[0] != goals[1] != goals[2]
    vector = gymnasium.make_vec("tangere/BoxPushingReduced-v0", 2, vectorization_mode="sync")
    goal = vector.reset()[0]["goal"]
    assert goal[0].tolist() != goal[1].tolist()


def play(env, steps):
    """What a grasp by a fixed hand shows, and where episodes end."""
    rows = []
    for _ in range(steps):
        obs, reward, terminated, truncated, info = env.step(env.scripted_action())
        rows.append((obs["flow"], reward, terminated | truncated, info))
    return rows


def test_next_step_shows_the_start_a_step_later():
    env = tangere.make_vec(SHORT, 4, threads=1)
    assert env.metadata["autoreset_mode"] is env.autoreset_mode is AutoresetMode.NEXT_STEP
    env.reset(seed=0)
    rows = play(env, 8)
    for (_, _, before, _), (_, reward, _, info) in zip(rows, rows[1:]):
        np.testing.assert_array_equal(info["starting"], before)
        assert (reward[before] == 0).all()
    assert any(done.any() for _, _, done, _ in rows)
    ends = [int(e) for _, _, done, info in rows for e in info["episode_id"][done]]
    starts = [int(e) for *_, info in rows for e in info["episode_id"][info["starting"]]]
    assert set(starts) <= {e + 4 for e in ends}


def test_same_step_shows_the_last_observation_beside_the_start():
    ones, twos = tangere.make_vec(SHORT, 4, threads=1), tangere.make_vec(
        SHORT, 4, threads=1, autoreset="same_step"
    )
    assert twos.metadata["autoreset_mode"] is twos.autoreset_mode is AutoresetMode.SAME_STEP
    ones.reset(seed=0), twos.reset(seed=0)
    action = ones.scripted_action()
    a, b = ones.step(action), twos.step(action)
    done = a[2] | a[3]
    assert done.any() and not done.all()
    np.testing.assert_array_equal(done, b[2] | b[3])
    np.testing.assert_array_equal(a[1], b[1])
    np.testing.assert_array_equal(b[4]["_final_obs"], done)
    np.testing.assert_array_equal(b[4]["final_info"]["success"], a[4]["success"])
    np.testing.assert_array_equal(b[4]["final_info"]["episode_id"], [0, 1, 2, 3])
    np.testing.assert_array_equal(b[4]["episode_id"], np.arange(4) + 4 * done)
    np.testing.assert_array_equal(b[4]["starting"], done)
    assert not b[4]["success"][done].any()
    next_obs = ones.step(action)[0]
    for e in range(4):
        if done[e]:
            np.testing.assert_array_equal(b[4]["final_obs"][e]["flow"], a[0]["flow"][e])
            np.testing.assert_array_equal(b[0]["flow"][e], next_obs["flow"][e])
        else:
            assert b[4]["final_obs"][e] is None
            np.testing.assert_array_equal(b[0]["flow"][e], a[0]["flow"][e])


def test_disabled_waits_for_a_mask():
    env = tangere.make_vec(SHORT, 4, threads=1, autoreset="disabled")
    env.reset(seed=0)
    obs, _, terminated, truncated, _ = env.step(env.scripted_action())
    done = terminated | truncated
    still = env.step(np.zeros((4, 1)))[0]
    np.testing.assert_array_equal(still["flow"][done], obs["flow"][done])
    started, info = env.reset(options={"reset_mask": done})
    np.testing.assert_array_equal(info["starting"], done)
    np.testing.assert_array_equal(started["flow"][~done], still["flow"][~done])
    assert not np.array_equal(started["flow"][done], obs["flow"][done])


def test_nothing_is_handed_out_twice():
    env = tangere.make_vec("box_pushing", 2, threads=1)
    obs, info = env.reset(seed=0)
    kept = {k: v.copy() for k, v in obs.items()}
    after = env.step(np.full((2, 3), 0.9, np.float32))
    same(obs, kept)
    reward = after[1].copy()
    env.step(np.zeros((2, 3)))
    np.testing.assert_array_equal(after[1], reward)


def test_a_scene_may_be_named_by_its_file():
    path = tangere.gym.task_scene("box_pushing").path
    for scene in (path, tangere.Scene(path)):
        env = tangere.make_env("box_pushing", scene=scene)
        assert env.model.q_names == tangere.make_vec("box_pushing", 1).model.q_names
        same(env.reset(seed=1)[0], tangere.make_env("box_pushing").reset(seed=1)[0])


def test_one_action_may_be_for_all():
    first, second = (tangere.make_vec("box_pushing", 2, threads=1) for _ in range(2))
    first.reset(seed=1), second.reset(seed=1)
    same(first.step([0.1, 0.2, 0.3])[0], second.step(np.tile([0.1, 0.2, 0.3], (2, 1)))[0])


def test_a_failed_simulation_truncates():
    env = tangere.make_vec("box_pushing", 3, threads=1)
    env.reset(seed=0)
    actions = np.zeros((3, 3))
    actions[1] = np.nan
    _, reward, terminated, truncated, info = env.step(actions)
    assert truncated.tolist() == [False, True, False] and not terminated.any()
    assert info["status"].tolist() == [0, -2, 0] and np.isfinite(reward).all()


# Crossed planks of 10 mm that overlap by 5 mm; their contact points, the corners, are outside.
PLANKS = """
<robot><link name="low"><joint name="low" type="fixed" pos="1 0 1"/>
  <body name="low" type="cuboid" size="0.4 0.02 0.01" density="1000"/></link></robot>
<robot><link name="high"><joint name="high" type="prismatic" axis="1 0 0" pos="1 0 1.005"/>
  <body name="high" type="cuboid" size="0.02 0.4 0.01" density="1000"/></link></robot>
<contact><general_primitive_contact general_body="high" primitive_body="low"/></contact>
</tangere>"""


def test_counts_say_how_many_steps_had_which_status(tmp_path):
    text = Path(tangere.gym.task_scene("dummy").path).read_text(encoding="utf-8")
    path = tmp_path / "planks.xml"
    path.write_text(text.replace("</tangere>", PLANKS), encoding="utf-8")
    with pytest.warns(UserWarning, match="contact points of 'high' are up to 0.08 m apart"):
        planks = tangere.Scene(path)
    for scene, overlapping in [(None, 0), (planks, 30)]:
        env = tangere.make_vec("dummy", 3, scene=scene)
        env.reset(seed=0)
        for _ in range(2):
            _, _, _, _, info = env.step(np.zeros((3, 1)))
        assert info["status"].tolist() == [5 if overlapping else 0] * 3
        counts = env.counts()
        assert counts.pop("newton_iterations") >= 30
        assert counts == {
            "environment_steps": 6, "simulation_steps": 30, "split_steps": 0,
            "accuracy_not_met_steps": 0,
            "tunnelled_steps": 0, "damped_steps": 0, "overlapping_steps": overlapping,
        }  # fmt: skip


def test_mistakes_are_told():
    for arguments, message in [
        ({"keys": ["touch"]}, r"keys \['touch'\]; task 'box_pushing' has \['goal', 'tactile'\]"),
        ({"keys": []}, "keys"),
        ({"keys": "goal"}, r"keys 'goal'; expected a list"),
        ({"autoreset": "never"}, "autoreset 'never'"),
        ({"num_envs": 0}, "num_envs 0; expected a whole number from 1 on"),
        ({"num_envs": -1}, "num_envs -1"),
        ({"num_envs": "8"}, "num_envs '8'"),
    ]:
        with pytest.raises(tangere.InputError, match=message):
            tangere.make_vec("box_pushing", **{"num_envs": 2, **arguments})
    env = tangere.make_env("box_pushing")
    with pytest.raises(tangere.InputError, match="reset"):
        env.step(np.zeros(3))
    env.reset(seed=0)
    with pytest.raises(tangere.InputError, match=r"an action of shape \(4,\); expected \(3,\)"):
        env.step(np.zeros(4))
    vector = tangere.make_vec("box_pushing", 2)
    with pytest.raises(tangere.InputError, match=r"options \['speed'\]"):
        vector.reset(options={"speed": 1})
    with pytest.raises(tangere.InputError, match=r"actions of shape \(3, 3\); expected \(2, 3\)"):
        vector.step(np.zeros((3, 3)))
    with pytest.raises(tangere.InputError, match=r"shape \(2,\); expected \(2, 3\) or \(3,\)"):
        vector.step(np.zeros(2))
