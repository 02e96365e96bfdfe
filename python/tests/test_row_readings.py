# SPDX-License-Identifier: Apache-2.0
"""Readings of sensors in rows of environments: those that a data set of the same episodes has."""

from __future__ import annotations

import json
import pickle

import gymnasium
import h5py
import numpy as np
import pytest
from ball_rolling import NAME as TWIN
from ball_rolling import BallRolling
from gymnasium.envs.registration import EnvSpec

import tangere
from tangere import data as data_sets
from tangere.data import Episodes

WORDS = ["pad/1", "pad.sum/1", "pad.shear"]
SHAPES = {"pad": (5, 13, 10, 3), "pad.sum": (5, 6), "pad.shear": (13, 10, 2)}


@pytest.fixture(scope="module")
def touched(generate):
    """Three scripted episodes of box pushing with the readings of each action."""
    return generate("box_pushing", "--episodes", "3", "--seed", "5", "--record",
                    "q,v,goal," + ",".join(WORDS))  # fmt: skip


@pytest.mark.parametrize("autoreset", ["same_step", "next_step", "disabled"])
def test_an_environment_shows_what_a_data_set_has(touched, autoreset):
    episodes = Episodes(touched)
    env = tangere.make_vec("box_pushing", 3, seed=5, readings=WORDS, autoreset=autoreset)
    assert env.windows == episodes.windows == {"pad": 0.005, "pad.sum": 0.005}
    assert {key: env.single_observation_space[key].shape for key in SHAPES} == SHAPES
    assert env.observation_scale["pad"] == 1
    obs, _ = env.reset()
    rows = [[{key: obs[key][e] for key in SHAPES}] for e in range(3)]
    for _ in range(100):
        obs, _, _, truncated, info = env.step(env.scripted_action())
        for e in range(3):
            last = obs if autoreset != "same_step" or not truncated[e] else info["final_obs"][e]
            rows[e].append({key: last[key] if last is not obs else obs[key][e] for key in SHAPES})
    assert truncated.all() and env.observation_space.contains(obs)
    for e in range(3):
        for key in SHAPES:
            seen = np.stack([row[key] for row in rows[e]])
            wanted = np.concatenate([episodes[e][key], episodes.final(e)[key]])
            np.testing.assert_array_equal(seen, wanted, err_msg=f"{key} of episode {e}")
            assert np.abs(seen).max() > 0


def test_readings_are_shown_with_few_keys_flat_and_by_one_environment(touched):
    first = Episodes(touched)[0]
    one = gymnasium.make("tangere/BoxPushing-v0", readings=WORDS[:2], keys=["goal"], seed=5)
    obs, _ = one.reset(seed=5)
    assert [*obs] == ["goal", "pad", "pad.sum"] and one.unwrapped.windows["pad"] == 0.005
    np.testing.assert_array_equal(obs["pad"], first["pad"][0])
    flat = tangere.make_vec("box_pushing", 2, seed=5, readings=["pad/1"], keys=[], flatten=True)
    seen, _ = flat.reset()
    assert seen.dtype == np.float32 and flat.single_observation_space.shape == (5 * 390,)
    for _ in range(60):
        seen, *_ = flat.step(flat.scripted_action())
    np.testing.assert_array_equal(seen[0], first["pad"][60].ravel())
    again = pickle.loads(pickle.dumps(flat))
    assert again.windows == flat.windows and (again.reset()[0] == flat.reset(seed=5)[0]).all()


@pytest.mark.parametrize(
    "readings, message",
    [
        (["pads/1"], "readings: no sensor has 'pads'; did you mean 'pad'"),
        (["pad/2"], "'pad/2', and a row is every 5 steps; expected a divisor of 5"),
        (["pad/5"], "'pad/5' of a task; expected 'pad', which is in every row, or a window"),
        (["pad/x"], "pad/x"),
        (["tactile"], "readings: no sensor has 'tactile'"),
        (["q"], "readings: no sensor has 'q'; expected readings of the sensors pad, such as"),
        ("pad/1", "readings 'pad/1'; expected a list"),
    ],
)
def test_readings_that_are_none(readings, message):
    with pytest.raises(tangere.InputError, match=message):
        tangere.make_vec("box_pushing", 1, readings=readings)


def test_learners_make_the_environment_of_a_file(touched):
    with h5py.File(touched / "robomimic.hdf5") as file:
        arguments = json.loads(file["data"].attrs["env_args"])["env_kwargs"]
    words = ["pad/1", "pad.shear", "pad.sum/1"]
    assert arguments == {"task": "box_pushing", "readings": words}
    (path,) = touched.glob("minari/**/metadata.json")
    metadata = json.loads(path.read_text())
    env = gymnasium.make(EnvSpec.from_json(metadata["env_spec"]))
    stored = json.loads(metadata["observation_space"])["subspaces"]
    assert {key: env.observation_space[key].shape for key in stored} == {
        key: tuple(box["shape"]) for key, box in stored.items()
    }


def test_a_policy_that_reads_windows_is_played(touched, tmp_path):
    lerobot = pytest.importorskip("tangere.lerobot", reason="pyarrow is not installed")
    lerobot.export(touched, tmp_path / "set")
    seen = []

    def choose(frames):
        seen.append(frames)
        return np.zeros((2, 3))

    found = lerobot.play(choose, tmp_path / "set", 2, seed=5)
    assert found["episodes"] == 2 and found["mean_actions"] == 100
    start = Episodes(touched)[0]
    for key in ("pad", "pad.shear", "pad.sum"):
        frames = seen[0][f"observation.{key}"]
        np.testing.assert_array_equal(frames[0], start[key][0], err_msg=key)


class Rolling(BallRolling):
    """The twin of a task of the catalogue, with readings."""

    readings = ("pad.sum/1", "pad.shear")


class Warm(Rolling):
    warm_up = True


def pressed(env, count):
    """Observations of episodes that press the ball, the last ones of each among them."""
    rows = [env.reset(seed=3)[0]]
    for _ in range(count):
        obs, _, terminated, truncated, info = env.step(np.array([0.2, -0.1, -0.5]))
        ended = terminated | truncated
        if "final_obs" in info and ended.all():
            last = info["final_obs"]
            rows.append({key: np.stack([one[key] for one in last]) for key in last[0]})
        rows.append(obs)
    return rows


@pytest.mark.parametrize("autoreset", ["same_step", "next_step"])
def test_a_task_in_python_shows_what_its_twin_does(autoreset):
    horizon = {"horizon": tangere.task_spec(TWIN).horizon}
    task = type("Twin", (Rolling,), horizon)
    twins = (
        task(18, seed=3, autoreset=autoreset),
        tangere.make_vec(TWIN, 18, seed=3, readings=Rolling.readings, autoreset=autoreset),
    )
    assert twins[0].windows == twins[1].windows == {"pad.sum": 0.005}
    mine, theirs = (pressed(env, horizon["horizon"] + 5) for env in twins)
    for t, (a, b) in enumerate(zip(mine, theirs, strict=True)):
        for key in ("pad.sum", "pad.shear"):
            np.testing.assert_array_equal(a[key], b[key], err_msg=f"{key} of row {t}")
    assert mine[0]["pad.sum"].shape == (18, 5, 6)
    assert any((np.diff(row["pad.sum"], axis=1) != 0).any() for row in mine)


def test_a_warm_up_fills_the_first_window():
    env = Warm(2, seed=3)
    first = env.reset(seed=3)[0]["pad.sum"]
    batch = tangere.Batch(env.model, 2, seed=3)
    run = batch.run(np.zeros((5, 2, 3)), fields=["pad.sum"])
    np.testing.assert_array_equal(first, np.swapaxes(run.fields["pad.sum"], 0, 1))


def test_data_sets_of_a_task_in_python_have_windows(tmp_path):
    said = data_sets.generate(Rolling, tmp_path / "set", 20, policy="random", seed=2, num_envs=3)
    assert said["episodes"] == 20
    episodes = Episodes(tmp_path / "set")
    assert episodes.windows == {"pad.sum": 0.005} and "pad.sum" in episodes.touch
    env = Rolling(20, seed=2, autoreset="disabled")
    rows = [env.reset()[0]]
    for t in range(env.horizon):
        actions = np.stack([episodes[e]["actions"][t] for e in range(20)])
        rows.append(env.step(actions)[0])
    for e in range(20):
        for key in ("pad.sum", "pad.shear", "tactile"):
            seen = np.stack([row[key][e] for row in rows])
            wanted = np.concatenate([episodes[e][key], episodes.final(e)[key]])
            np.testing.assert_array_equal(seen, wanted, err_msg=f"{key} of episode {e}")


class Stepping(Rolling):
    def simulate(self, controls, envs):
        self.batch.run(controls, every=len(controls), envs=envs)


class Halving(Rolling):
    def simulate(self, controls, envs):
        super().simulate(controls[:2], envs)


@pytest.mark.parametrize(
    "task, readings, message",
    [
        (Rolling, ["pads.sum"], r"reading 'pads.sum'; expected one of a sensor of \['pad'\]"),
        (Rolling, ["pad.sum/2"], "reading 'pad.sum/2'; expected a divisor of 5"),
        (Rolling, ["pad.sum/5"], "reading 'pad.sum/5'; expected 'pad.sum', or a window of less"),
        (Rolling, ["pad.sum/0"], "reading 'pad.sum/0'; expected 'pad.sum', or a window of less"),
        (Rolling, ["pad.sum", "pad.sum/1"], "reading 'pad.sum' twice"),
        (Rolling, "pad.sum", r"readings 'pad.sum'; expected a list"),
        (Rolling, ["pad/1"], r"observe\(\)\['pad'\], which is in `readings`"),
        (Stepping, ["pad.sum/1"], r"simulate\(\) without the readings of the windows"),
        (Halving, ["pad.sum/1"], r"simulate\(\) of 2 steps with windows of touch; expected 5"),
    ],
)
def test_readings_of_a_task_in_python_that_are_none(task, readings, message):
    with pytest.raises(tangere.InputError, match=f"{task.__name__}: {message}"):
        type(task.__name__, (task,), {"readings": readings})(1, seed=1).step(np.zeros(3))


def test_a_tape_has_no_readings():
    torch = pytest.importorskip("tangere.torch", reason="torch is not installed")
    task = type("Taped", (Rolling,), {"arrays": "torch"})
    with pytest.raises(tangere.InputError, match="Taped: readings .*pad.sum/1.* of a tape"):
        torch.EnvTape(task, 1)
