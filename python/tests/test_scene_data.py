# SPDX-License-Identifier: Apache-2.0
"""Data sets of tasks in Python: a twin of a C++ task, any number of environments, every reader."""

from __future__ import annotations

import json
import subprocess
import warnings
from concurrent.futures import ThreadPoolExecutor

import gymnasium
import h5py
import numpy as np
import pytest
from ball_rolling import NAME as TWIN
from ball_rolling import BallRolling
from gymnasium.envs.registration import EnvSpec

import tangere
from tangere.data import Episodes, Windows, generate

class Twin(BallRolling):
    """`goals` are those that the task of the catalogue draws."""

    horizon = tangere.task_spec(TWIN).horizon
    units = {"pad": "m", "goal": "m", "tactile": "N", "action": "1"}
    touch = ("tactile",)
    goals = np.zeros((0, 2))

    def restart(self, envs):
        super().restart(envs)
        self.goal[envs] = self.goals[self.episodes[envs]]

    def success(self):
        left = np.linalg.norm(self.distance(), axis=1)
        return (self.lengths == self.horizon) & (left < 2e-3)


def roll(obs, episodes, actions):
    """Rolls the ball to its goal; some episodes press too hard to come there."""
    press = np.where(episodes % 3, -0.5, -0.05) + 0.01 * (actions % 4)
    return np.concatenate([40 * obs["goal"], press[:, None]], 1)


@pytest.fixture(scope="module")
def twins(tmp_path_factory):
    folder = tmp_path_factory.mktemp("twins")
    env = tangere.make_vec(TWIN, 20, seed=3)
    env.reset()
    Twin.goals = env.state()[2]
    said = [
        generate(what, folder / str(k), 20, policy=roll, seed=3, normalise=False, threads=1)
        for k, what in enumerate((TWIN, Twin))
    ]
    return folder, said


def test_the_twin_of_a_task_has_its_data_set(twins):
    folder, (theirs, ours) = twins
    for key in ("policy", "episodes", "rows", "successes", "success_rate", "simulation_steps"):
        assert ours[key] == theirs[key], key
    assert ours["mean_return"] == pytest.approx(theirs["mean_return"], rel=1e-12)
    assert 0 < ours["successes"] < 20 and ours["minari_id"] == "tangere/Twin/roll-v0"
    with h5py.File(folder / "0/shard-00000.h5") as a, h5py.File(folder / "1/shard-00000.h5") as b:
        assert set(a["data"]) == set(b["data"]) and len(a["data"]) == 20
        for name, demo in a["data"].items():
            twin = b["data"][name]
            assert set(twin.attrs) == set(demo.attrs)
            for key, value in demo.attrs.items():
                np.testing.assert_allclose(twin.attrs[key], value, rtol=1e-12, err_msg=key)
            members = []
            demo.visit(members.append)
            for member in members:
                if isinstance(demo[member], h5py.Dataset):
                    assert twin[member].dtype == demo[member].dtype
                    np.testing.assert_array_equal(twin[member][()], demo[member][()], member)
        felt = [demo.attrs["touching"] for demo in b["data"].values()]
        assert max(felt) > 0
        for key in ("simulation_steps", "tunnelled_steps", "overlapping_steps"):
            assert a.attrs[key] == b.attrs[key], key
        here, there = b["scene"].attrs, a["scene"].attrs
        other = {"task", "success", "dataset_id", "observation_scale", "observation_meanings",
                 "action_meaning", "action_names"}  # fmt: skip
        assert set(here) == set(there) | {"python_class"}
        for key in set(there) - other:
            np.testing.assert_array_equal(here[key], there[key], err_msg=key)


class Leaves(tangere.VectorSceneEnv):
    """Ends at different times; some episodes fail in the simulation."""

    scene, steps_per_action, horizon = Twin.scene, 5, 9

    def restart(self, envs):
        if not hasattr(self, "last"):
            self.last = np.zeros(self.num_envs, int)
        self.last[envs] = self.uniform(envs, 1, 12).astype(int)

    def observe(self):
        return {"left": self.last - self.lengths, "pad.sum": self.batch.tactile("pad.sum")}

    def controls(self, actions):
        fails = (self.episodes % 7 == 5) & (self.lengths == 3)
        return np.where(fails[:, None], np.nan, actions)

    def reward(self, actions):
        return self.last - self.lengths - actions[:, 0]

    def terminated(self):
        return self.lengths >= self.last



def push(obs, episodes, actions):
    assert obs["left"].shape == episodes.shape == actions.shape
    return np.stack([0.1 * obs["left"], 0.01 * episodes, -0.1 * actions], 1)


@pytest.mark.parametrize("policy", ["random", push])
def test_environments_and_threads_change_no_byte(tmp_path, policy):
    made = []
    for envs, threads in ((1, 1), (3, 1), (16, 2), (100, 2)):
        folder = tmp_path / str(envs)
        said = generate(Leaves, folder, 70, policy=policy, seed=2, num_envs=envs, threads=threads)
        paths = sorted(path for path in folder.rglob("*") if path.is_file())
        made.append((said | {"output": "", "shards": [], "merged": ""},
                     {path.relative_to(folder): path.read_bytes() for path in paths}))  # fmt: skip
        assert len(paths) == 4  # a shard, robomimic.hdf5, two files for Minari
    for said, files in made[1:]:
        assert said == made[0][0] and files == made[0][1]
    lengths = Episodes(tmp_path / "1").lengths
    assert lengths.min() == 1 and lengths.max() == 9


class Bursts(tangere.VectorSceneEnv):
    """In every third episode velocities leave the range of float32, and the simulation fails."""

    scene, horizon = Twin.scene, 4

    def simulate(self, controls, envs):
        if len(bursting := envs[(self.episodes[envs] % 3 == 1) & (self.lengths[envs] == 2)]):
            v = np.full((len(bursting), self.model.nv), 1e200)
            self.batch.set_state(self.batch.q[bursting], v, envs=bursting)
        super().simulate(controls, envs)

    def reward(self, actions):
        return np.zeros(self.num_envs)


def test_a_state_beyond_float32_is_a_failure_and_no_warning(tmp_path):
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        said = generate(Bursts, tmp_path / "set", 9, policy="random", seed=1, num_envs=4)
    assert [f["episode"] for f in said["failed"]] == [1, 4, 7] and said["rows"] == 6 * 4
    assert {f["reason"] for f in said["failed"]} == {"non_finite"}
    episodes = Episodes(tmp_path / "set")
    assert len(episodes) == 6 and all(np.isfinite(e["v"]).all() for e in episodes)
    env = Bursts(2, seed=1)
    for _ in range(3):
        obs, *_, info = env.step(np.zeros(3))
    assert list(info["status"] < 0) == [False, True]
    assert (obs["v"][1] == np.finfo(np.float32).max).all() and np.isfinite(obs["v"]).all()
    env.batch.set_state(env.batch.q, np.full(env.model.nv, 1e200))
    with pytest.raises(tangere.InputError, match=r"observe\(\)\['v'\] with numbers that are not"):
        env._observe()


def test_environments_wait_for_a_long_episode_before_theirs(tmp_path):
    class Long(Leaves):
        def restart(self, envs):
            super().restart(envs)
            self.last[envs] = np.where(self.episodes[envs] % 20, 1, 9)

    for envs in (1, 16):
        generate(Long, tmp_path / str(envs), 100, policy=push, seed=2, num_envs=envs)
    one, many = ((tmp_path / str(envs) / "shard-00000.h5").read_bytes() for envs in (1, 16))
    assert one == many and len(Episodes(tmp_path / "16")) == 99  # 40 fails


def test_rows_are_those_of_the_environment(tmp_path):
    """Also failed episodes, which are no demos."""
    asked = []

    def choose(obs, episodes, actions):
        asked.extend(zip(episodes.tolist(), actions.tolist()))
        return push(obs, episodes, actions)

    said = generate(Leaves, tmp_path / "set", 40, policy=choose, seed=2, num_envs=5)
    env = Leaves(1, seed=2, autoreset="disabled")
    failed = []
    with h5py.File(tmp_path / "set/shard-00000.h5") as file:
        assert file["scene"].attrs["policies"][0] == "choose"
        for e in range(40):
            obs, _ = env.reset(seed=2, options={"first_episode": e})
            rows, rewards, done = [obs], [], False
            states = [env.batch.q[0]]
            while not done:
                action = push(obs, np.array([e]), env.lengths)
                obs, reward, terminated, truncated, info = env.step(action)
                rows.append(obs), rewards.append(reward[0]), states.append(env.batch.q[0])
                done = terminated[0] or truncated[0]
            if info["status"][0] < 0:
                failure = file[f"failed/episode_{e}"]
                assert failure.attrs["step"] == 15 and failure.attrs["status"] == info["status"][0]
                np.testing.assert_array_equal(failure.attrs["q"], states[-1])
                failed.append(e)
                continue
            demo = file[f"data/demo_{e}"]
            assert demo.attrs["num_samples"] == len(rewards)
            assert demo.attrs["return"] == sum(rewards)
            assert demo.attrs["terminated"] == terminated[0]
            np.testing.assert_array_equal(demo["rewards"], np.float32(rewards))
            for key in ("left", "pad.sum"):
                kept = np.concatenate([demo["obs"][key], demo["final_obs"][key]])
                np.testing.assert_array_equal(kept, np.concatenate([r[key] for r in rows]))
            kept = np.concatenate([demo["obs/q"], demo["final_obs/q"]])
            np.testing.assert_array_equal(kept, np.float32(states))
    assert failed and [f["episode"] for f in said["failed"]] == failed
    assert said["failed"][0]["reason"] == "non_finite"
    assert len(asked) == len(set(asked)) and {e for e, _ in asked} == set(range(40))
    assert [t for e, t in asked if e == 3] == sorted(t for e, t in asked if e == 3)


def test_every_reader_opens_it(twins, command, tmp_path):
    folder = twins[0] / "1"
    windows = Windows(folder, before=1, ahead=4, only_success=True)
    item = windows[0]
    assert windows.keys == ["pad", "goal", "tactile"] and item["actions"].shape == (4, 3)
    assert item["obs"]["tactile"].shape == (2, 32, 32, 3)
    episodes = Episodes(folder)
    assert (episodes.felt() > 0).any() and 0 < len(episodes.succeeded()) < 20

    def run(*words):
        done = subprocess.run([command, *words], stdin=subprocess.DEVNULL, capture_output=True)
        assert done.returncode == 0, done.stderr.decode()
        return done.stdout.decode()

    assert "task: Twin" in run("info", folder) and "whole" in run("validate", folder)
    run("merge", folder, "--overwrite")
    run("validate", folder / "robomimic.hdf5")
    run("export", folder, "--csv", tmp_path / "rows.csv")
    run("view", folder, "--output", tmp_path / "page.html")
    with h5py.File(folder / "robomimic.hdf5") as file:
        environment = json.loads(file["data"].attrs["env_args"])
        assert environment["env_name"] == "tangere/Twin-v0"
        assert environment["env_kwargs"] == {"task": f"{__name__}:Twin"}
        assert {"train", "valid", "train_success", "train_touching"} < set(file["mask"])
        demo = file["data/demo_7"]
        for key in ("q", "v", "pad", "goal", "tactile"):
            np.testing.assert_array_equal(demo["next_obs"][key][:-1], demo["obs"][key][1:])
        assert set(demo) == {"actions", "rewards", "dones", "obs", "next_obs", "final_obs"}
    metadata = json.loads((folder / "minari/tangere/Twin/roll-v0/data/metadata.json").read_text())
    env = gymnasium.make(EnvSpec.from_json(metadata["env_spec"]))
    assert env.unwrapped._vector.__class__.__name__ == "Twin"
    assert {key for key in env.observation_space} == {"pad", "goal", "tactile"}


def test_lerobot_exports_it(twins, tmp_path):
    lerobot = pytest.importorskip("tangere.lerobot", reason="pyarrow is not installed")
    done = lerobot.export(twins[0] / "1", tmp_path / "set", only_success=True)
    assert done.episodes == twins[1][1]["successes"] and done.frames == 70 * done.episodes


def test_minari_loads_it(twins, monkeypatch):
    minari = pytest.importorskip("minari", reason="Minari is not installed")
    monkeypatch.setenv("MINARI_DATASETS_PATH", str(twins[0] / "1/minari"))
    dataset = minari.load_dataset("tangere/Twin/roll-v0")
    assert dataset.total_episodes == 20
    assert dataset.recover_environment().observation_space["pad"].shape == (3,)


def test_q_and_v_of_the_default_observations_are_the_state(tmp_path):
    class Bare(tangere.VectorSceneEnv):
        scene, horizon = tangere.scenes()["rolling_ball_small"], 3
        privileged = ("q",)

        def reward(self, actions):
            return np.zeros(self.num_envs)

    generate(Bare, tmp_path / "set", 3, policy="random", num_envs=2)
    episodes = Episodes(tmp_path / "set")
    assert episodes.keys == ["q", "v", "pad"] and episodes.privileged == ["q", "v"]
    env = Bare(1, autoreset="disabled")
    assert (episodes[2]["q"][0] == env.reset(seed=0, options={"first_episode": 2})[0]["q"]).all()
    assert Windows(tmp_path / "set", keys=["q", "pad"], split=None)[0]["obs"]["q"].shape == (1, 10)

    class Noisy(Bare):
        def observe(self):
            return {"q": self.batch.q + 1, "x": self.batch.v}

    with pytest.raises(tangere.InputError, match=r"observe\(\)\['q'\] that is not batch.q"):
        generate(Noisy, tmp_path / "noisy", 3, policy="random")
    assert not (tmp_path / "noisy").exists()


def test_randomized_numbers_and_bounds_of_each_number_are_stored(tmp_path):
    class Press(Leaves):
        action_low, action_high = (-1, -2, -0.5), (1, 0, 0)

    for envs in (1, 4):
        generate(Press, tmp_path / str(envs), 20, policy="random", num_envs=envs)
    with h5py.File(tmp_path / "1/shard-00000.h5") as file:
        drawn = Press(20, seed=0).randomized()
        assert list(file["scene"].attrs["randomized_names"]) == list(drawn)
        for name, demo in file["data"].items():
            e = int(name[5:])
            wanted = [values[e] for values in drawn.values()]
            np.testing.assert_array_equal(demo.attrs["randomized"], wanted)
            actions = demo["actions"][()]
            assert (actions >= [-1, -2, -0.5]).all() and (actions <= [1, 0, 0]).all()
        assert file["scene"].attrs["action_low"] == -2 and file["scene"].attrs["action_high"] == 1
        assert "[-1.0, -2.0, -0.5] to [1.0, 0.0, 0.0]" in file["scene"].attrs["action_meaning"]


def test_shards_that_are_complete_stay(tmp_path):
    whole = generate(Leaves, tmp_path / "whole", 70, policy=push, options=("--shards", "3"))
    assert len(whole["shards"]) == 3
    stopped = []

    def stops(obs, episodes, actions):
        if episodes.max() > 60 and not stopped:
            stopped.append(1)
            raise KeyboardInterrupt
        return push(obs, episodes, actions)

    words = ("--shards", "3")
    with pytest.raises(KeyboardInterrupt):
        generate(Leaves, tmp_path / "set", 70, policy=stops, name="push", num_envs=4, options=words)
    left = sorted(path.name for path in (tmp_path / "set").iterdir())
    assert left == ["shard-00000.h5", "shard-00001.h5"]
    with pytest.raises(tangere.IoError, match="has shards already; give --overwrite"):
        generate(Leaves, tmp_path / "set", 70, policy=push, options=words)
    with pytest.raises(tangere.InputError, match="belongs to another run.*seed: 0 there, 5 here"):
        generate(Leaves, tmp_path / "set", 70, policy=push, seed=5, options=(*words, "--resume"))
    said = generate(Leaves, tmp_path / "set", 70, policy=push, options=(*words, "--resume"))
    assert (said["kept"], said["episodes"]) == (2, 22)
    for number in range(3):
        name = f"shard-0000{number}.h5"
        assert (tmp_path / "set" / name).read_bytes() == (tmp_path / "whole" / name).read_bytes()
    again = generate(Leaves, tmp_path / "set", 20, policy="random", options=["--overwrite"])
    assert len(again["shards"]) == 1 and len(Episodes(tmp_path / "set")) == 18


def test_storage_is_that_of_the_command(twins, tmp_path):
    words = ("--compress", "deflate", "--tactile", "sparse", "--name", "small")
    said = generate(Twin, tmp_path / "set", 20, policy=roll, seed=3, num_envs=7, options=words)
    assert said["minari_id"] == "tangere/Twin/small-v0"
    with h5py.File(said["shards"][0]) as file:
        with h5py.File(twins[1][1]["shards"][0]) as plain:
            assert file.attrs["content_sum"] == plain.attrs["content_sum"]
        assert file["data/demo_3/obs/tactile"].compression == "gzip"
        assert "'--compress', 'deflate'" in file.attrs["command"]


def with_(**members):
    return type("Mine", (Leaves,), members)


def zeros(obs, episodes, actions):
    return np.zeros((len(episodes), 3))


@pytest.mark.parametrize(
    ("given", "message"),
    [
        ({"episodes": 0}, "0 episodes; expected 1 or more"),
        ({"num_envs": 0}, "num_envs 0"),
        ({"policy": None}, "policy None of Leaves; expected a function or 'random'"),
        ({"policy": "scripted"}, "policy 'scripted' of Leaves; expected"),
        ({"policy": lambda *a: zeros(*a)}, "a function as policy without a name"),
        ({"name": "two words"}, "the policy calls itself 'two words'; expected 1 to 64"),
        ({"name": "train"}, "no name of a mask"),
        ({"policy": lambda o, e, a: np.zeros((len(e), 2)), "name": "x"},
         r"actions of shape \(20, 2\); expected \(20, 3\)"),
        ({"policy": lambda o, e, a: np.full((len(e), 3), np.nan), "name": "x"},
         "the policy gives nan as number 0 of action 0 of episode 0; expected a finite number"),
        ({"options": ["--gradients", "x"]}, "'--gradients' with 'x'; expected --overwrite"),
        ({"options": ["--compress", "zip"]}, "'--compress' with 'zip'; expected"),
        ({"options": ["--shards", "3"]}, "3 shards of 20 episodes; expected at most 2"),
        ({"what": with_(observe=lambda s: {"dones": s.last})}, r"\['dones'\], the name of another"),
        ({"what": with_(observe=lambda s: {"a/b": s.last})}, "observation 'a/b'; expected another"),
        ({"what": with_(units={"x": "m"})}, r"Mine: units \['x'\]; expected some of \['left'"),
        ({"what": with_(touch=["action"])}, r"Mine: touch \['action'\]; expected some of"),
        ({"what": type(TWIN, (Leaves,), {})}, "the name of a task of the catalogue"),
        ({"what": int}, "int; expected a subclass of tangere.VectorSceneEnv"),
        ({"what": TWIN, "num_envs": 3}, "num_envs 3 with 'ball_rolling_small'; expected a class"),
    ],
)  # fmt: skip
def test_faults_name_the_value_and_leave_nothing(tmp_path, given, message):
    words = {"what": Leaves, "output": tmp_path / "set", "episodes": 20, "policy": zeros}
    with pytest.raises(tangere.InputError, match=message):
        generate(**{**words, **given})
    assert not list(tmp_path.iterdir())


def test_what_the_task_raises_is_passed_on(tmp_path):
    def late(self, actions):
        return np.full(self.num_envs, np.nan) if self.episodes.max() > 30 else self.last

    with pytest.raises(tangere.InputError, match=r"Mine: reward\(\) nan in environment 0"):
        generate(with_(reward=late), tmp_path / "set", 40, policy=zeros, num_envs=4)
    assert not list(tmp_path.iterdir())


def test_a_folder_is_held_by_one_run(tmp_path):
    def nested(obs, episodes, actions):
        if episodes[0] == 0 and actions[0] == 0:
            with ThreadPoolExecutor(1) as pool:
                with pytest.raises(tangere.IoError, match="another"):
                    pool.submit(generate, Leaves, tmp_path / "set", 2, policy=zeros).result()
        return zeros(obs, episodes, actions)

    generate(Leaves, tmp_path / "set", 2, policy=nested)


def test_blocks_have_their_place_and_shape(tmp_path):
    core, model = tangere._core, tangere.Model(tangere.Scene(Twin.scene))
    action, seen = core.TensorSpec("action", (3,), "1"), core.TensorSpec("x", (2,), "m")
    task = core.TaskSpec("Mine", model.scene.path, "never", action, [seen], 5, 4)
    writer = core.EpisodeWriter(
        model, task, str(tmp_path / "set"), 20, 0, "random", "random", "here:Mine", "again"
    )
    rows = [np.zeros((4, 5, n), np.float32) for n in (model.nq, model.nv, 2)]
    block = {
        "first_episode": 16, "actions": np.zeros((4, 4, 3)), "observations": rows,
        "rewards": np.zeros((4, 4)), "randomized": np.zeros((4, 4)), "lengths": [4, 4, 4, 4],
        "returns": np.zeros(4), "terminated": [False] * 4, "success": [False] * 4,
        "failures": [], "steps": (80, 0, 0),
    }  # fmt: skip
    for given, message in (
        ({"first_episode": 8}, "4 episodes from 8 on; expected a block of 16 of 0 to 19"),
        ({"first_episode": 32}, "4 episodes from 32 on"),
        ({"lengths": [4, 4, 5, 4]}, "an episode of 5 actions; expected 1 to 4"),
        ({"observations": rows[:2]}, "2 observations; expected 3"),
        ({"rewards": np.zeros((4, 5))}, r"rewards of shape \(4, 5\); expected \(4, 4\)"),
    ):
        with pytest.raises(tangere.InputError, match=message):
            writer.write(**{**block, **given})
    writer.write(**block)
    writer.close()
    assert not (tmp_path / "set").exists()
    with pytest.raises(tangere.InputError, match="a data set that is closed"):
        writer.missing()


def test_words_and_ids_are_named(tmp_path):
    with pytest.raises(tangere.InputError, match=r"options '--overwrite'; .* as \['--overwrite'\]"):
        generate(Leaves, tmp_path / "set", 2, policy=zeros, options="--overwrite")
    with pytest.raises(tangere.InputError, match="'CartPole-v1' of Gymnasium is no environment"):
        generate("CartPole-v1", tmp_path / "set", 2)
    assert not list(tmp_path.iterdir())


def test_ids_of_gymnasium_name_tasks(tmp_path, monkeypatch):
    monkeypatch.setattr(gymnasium.envs.registration, "registry", dict(gymnasium.registry))
    monkeypatch.setattr(gymnasium, "registry", gymnasium.envs.registration.registry)
    tangere.register_scene_env("Leaves-v0", Leaves, scene=Leaves.scene)
    said = generate("Leaves-v0", tmp_path / "id", 3, policy=push, seed=5)
    assert said["episodes"] == 3
    generate(Leaves, tmp_path / "class", 3, policy=push, seed=5)
    with h5py.File(tmp_path / "id" / "robomimic.hdf5") as a:
        with h5py.File(tmp_path / "class" / "robomimic.hdf5") as b:
            assert a.attrs["command"].startswith("tangere.data.generate('Leaves-v0', OUTPUT, 3")
            assert a.attrs["content_sum"] == b.attrs["content_sum"]
    catalogue = generate("tangere/BoxPushing-v0", tmp_path / "push", 2, policy="random")
    assert catalogue["task"] == "box_pushing"
    tangere.register_scene_env("Seeded-v0", Leaves, seed=3)
    with pytest.raises(tangere.InputError, match=r"'Seeded-v0' is registered with \['seed'\]"):
        generate("Seeded-v0", tmp_path / "set", 2, policy="random")
