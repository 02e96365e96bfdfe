# SPDX-License-Identifier: Apache-2.0
"""Windows of a data set against the file, read with h5py alone."""

from __future__ import annotations

import pickle
from pathlib import Path

import h5py
import numpy as np
import pytest

import tangere
from tangere.data import Episodes, Windows


@pytest.fixture(scope="module")
def demo(pushes):
    with h5py.File(pushes / "robomimic.hdf5") as file:
        names = [n.decode() for n in file["mask/train"]]
        return {name: {k: file[f"data/{name}/obs/{k}"][()] for k in ("goal", "tactile")}
                | {"actions": file[f"data/{name}/actions"][()]} for name in names}  # fmt: skip


def test_windows_are_rows_of_the_file(pushes, demo):
    windows = Windows(pushes, before=2, ahead=3, scale="none")
    assert windows.keys == ["goal", "tactile"]  # q and v are privileged
    assert len(windows) == sum(len(d["actions"]) for d in demo.values())
    first = next(iter(demo.values()))
    middle, start, end = windows[50], windows[0], windows[99]
    np.testing.assert_array_equal(middle["obs"]["tactile"], first["tactile"][48:51])
    np.testing.assert_array_equal(middle["actions"], first["actions"][50:53])
    np.testing.assert_array_equal(middle["past_actions"], first["actions"][48:50])
    np.testing.assert_array_equal(start["obs"]["goal"], first["goal"][[0, 0, 0]])
    np.testing.assert_array_equal(start["past_actions"], np.zeros((2, 3)))
    np.testing.assert_array_equal(windows[1]["past_actions"], [np.zeros(3), first["actions"][0]])
    np.testing.assert_array_equal(end["actions"], first["actions"][[99, 99, 99]])
    np.testing.assert_array_equal(end["mask"], [1, 0, 0])
    second = list(demo.values())[1]
    np.testing.assert_array_equal(windows[100]["obs"]["goal"], second["goal"][[0, 0, 0]])
    for beyond in (len(windows), -1):
        with pytest.raises(IndexError):
            windows[beyond]


def test_what_follows_the_last_action_is_that_of_the_file(pushes):
    episodes = Episodes(pushes)
    with h5py.File(pushes / "robomimic.hdf5") as file:
        demo = file["data/demo_7"]
        final = episodes.final(7)
        np.testing.assert_array_equal(final["tactile"], demo["final_obs/tactile"][()])
        np.testing.assert_array_equal(final["q"], demo["next_obs/q"][-1:])
        assert np.abs(final["q"] - episodes[7]["q"][-1]).max() > 0
        assert not episodes.terminated(7) and demo.attrs["terminated"] == 0  # out of time


def test_an_episode_that_its_task_ended_is_told(generate):
    episodes = Episodes(generate("insertion_rotation", "--episodes", "4", "--seed", "2"))
    assert all(episodes.terminated(i) for i in episodes.succeeded()) and episodes.succeeded()


def test_batches_are_windows_each_once(pushes):
    windows = Windows(pushes, before=1, ahead=2)
    seen = [b["actions"] for b in windows.batches(300, seed=3)]
    assert sum(len(a) for a in seen) == len(windows)
    np.testing.assert_allclose(
        np.sort(np.concatenate(seen)[:, 0, 0]),
        np.sort([windows[i]["actions"][0, 0] for i in range(len(windows))]),
    )


def test_scales_are_those_of_the_environment(pushes):
    env = tangere.make_vec("box_pushing", 1, seed=5)
    windows = Windows(pushes, split=None)
    obs, _ = env.reset()
    for t in range(30):
        for key in obs:
            np.testing.assert_allclose(windows[t]["obs"][key][0], obs[key][0], rtol=1e-5, atol=1e-6)
        obs = env.step(windows[t]["actions"])[0]
    assert np.abs(obs["tactile"]).max() > 0


def test_standard_scores(pushes):
    windows = Windows(pushes, scale="standard")
    rows = np.concatenate([b["obs"]["goal"][:, 0] for b in windows.batches(500)])
    np.testing.assert_allclose(rows.mean(0), 0, atol=1e-3)
    assert (rows.std(0) <= 1 + 1e-3).all() and windows.std["tactile"].shape == (3,)
    valid = Windows(pushes, split="valid", scale="standard", statistics=windows)
    plain = Windows(pushes, split="valid", scale="none")
    goal = (plain[5]["obs"]["goal"] - windows.mean["goal"]) / windows.std["goal"]
    np.testing.assert_allclose(valid[5]["obs"]["goal"], goal, rtol=1e-4)


def test_forms(pushes):
    stored, image, points = (Windows(pushes, form=f)[60] for f in ("stored", "image", "points"))
    field = stored["obs"]["tactile"][0]
    assert field.shape == (13, 10, 3)
    np.testing.assert_array_equal(image["obs"]["tactile"][0], np.moveaxis(field, -1, 0))
    np.testing.assert_array_equal(points["obs"]["tactile"][0], field.reshape(130, 3))
    np.testing.assert_array_equal(points["obs"]["goal"], stored["obs"]["goal"])


def test_successes_and_masks(pushes):
    episodes = Episodes(pushes)
    solved = episodes.succeeded()
    assert 0 < len(solved) < 20
    assert episodes.mask("success") == solved
    assert len(Windows(episodes, split=None, only_success=True)) == 100 * len(solved)


def test_compressed_and_whole_data_are_the_same(generate, pushes):
    packed = generate("box_pushing", "--episodes", "20", "--seed", "5", "--compress", "lz4")
    a, b = Windows(pushes, scale="none"), Windows(packed, scale="none")
    for i in (0, 50, 1500):
        np.testing.assert_array_equal(a[i]["obs"]["tactile"], b[i]["obs"]["tactile"])


def test_deflate_is_read_too(generate, pushes):
    packed = generate("box_pushing", "--episodes", "20", "--seed", "5", "--compress", "deflate")
    a, b = Windows(pushes, scale="none"), Windows(packed, scale="none")
    np.testing.assert_array_equal(a[50]["obs"]["tactile"], b[50]["obs"]["tactile"])


def test_rows_too_large_for_memory_are_read_one_by_one(pushes):
    whole, parts = Windows(pushes, before=1), Windows(pushes, before=1, memory=0)
    items = np.array([5, 700, 6, 0, 1700])
    one, other = whole.gather(items), parts.gather(items)
    np.testing.assert_array_equal(one["obs"]["tactile"], other["obs"]["tactile"])
    np.testing.assert_array_equal(one["actions"], other["actions"])


def test_windows_go_to_another_process(pushes):
    windows = Windows(pushes)
    copy = pickle.loads(pickle.dumps(windows))
    np.testing.assert_array_equal(copy[7]["obs"]["goal"], windows[7]["obs"]["goal"])


def test_torch_loads_them(pushes):
    torch = pytest.importorskip("torch", reason="PyTorch is not installed")
    for workers in (0, 2):
        loader = torch.utils.data.DataLoader(Windows(pushes), 32, shuffle=True, num_workers=workers)
        assert len({b["obs"]["tactile"].shape for b in loader}) <= 2
    loader = torch.utils.data.DataLoader(Windows(pushes), batch_size=32, shuffle=True)
    batch = next(iter(loader))
    assert batch["obs"]["tactile"].shape == (32, 1, 13, 10, 3)


def test_an_observation_that_hides_an_array_is_told(pushes, tmp_path):
    with h5py.File(pushes / "shard-00000.h5") as file, h5py.File(tmp_path / "a.h5", "w") as copy:
        for name in file:
            file.copy(name, copy)
        copy.attrs.update(file.attrs)
        copy["data/demo_0/obs"].move("goal", "rewards")
    with pytest.raises(tangere.InputError, match="an observation is called 'rewards'"):
        Episodes(tmp_path / "a.h5")[0]


def test_a_scene_ends_no_episode(generate):
    balls = generate(str(tangere.scenes()["rolling_ball_small"]), "--episodes", "1", "--steps", "5",
                     "--every", "5", "--record", "q")  # fmt: skip
    assert Episodes(balls).terminated(0) is False


def test_samples_have_their_rows(generate):
    scene = Path(__file__).parents[2] / "scenes/rolling_ball_small.xml"
    steps = ("--episodes", "2", "--steps", "60", "--every", "10", "--precision", "double")
    whole = Episodes(generate(str(scene), *steps, "--record", "q,pad.sum"))
    some = Episodes(generate(str(scene), *steps, "--record", "pad.sum/30,q/final,bodies.ball"))
    assert some.keys == ["bodies.ball"] and whole.samples(0) == {}
    rows, sums = some.samples(1)["pad.sum"]
    np.testing.assert_array_equal(rows, [0, 3, 6])
    every = np.concatenate([whole[1]["pad.sum"], whole.final(1)["pad.sum"]])
    np.testing.assert_array_equal(sums, every[rows])
    rows, q = some.samples(1)["q"]
    np.testing.assert_array_equal(rows, [6])
    np.testing.assert_array_equal(q, whole.final(1)["q"])
    assert some[1]["bodies.ball"].shape == (6, 1, 13)


def test_a_missing_shard_is_told(generate):
    folder = generate("dummy", "--episodes", "32", "--shards", "2", "--no-merge")
    assert len(Episodes(folder)) == 32
    (folder / "shard-00001.h5").unlink()
    with pytest.raises(tangere.IoError, match="1 shards of 2"):
        Episodes(folder)


def test_mistakes_are_told(pushes, tmp_path):
    for arguments, message in [
        ({"keys": ["touch"]}, r"keys \['touch'\]; the data set has"),
        ({"scale": "unit"}, "scale 'unit'"),
        ({"form": "cube"}, "form 'cube'"),
        ({"before": -1}, "before -1"),
        ({"split": "test"}, "no mask 'test'"),
    ]:
        with pytest.raises(tangere.InputError, match=message):
            Windows(pushes, **arguments)
    with pytest.raises(tangere.IoError, match="no shard"):
        Windows(tmp_path)
    with pytest.raises(tangere.InputError, match="no 'grad_actions'"):
        Windows(pushes, gradients=["grad_actions"])[0]


def test_rows_in_which_something_is_felt(pushes, generate):
    episodes = Episodes(pushes)
    assert episodes.touch == ["tactile"]
    expected = [int(np.any(episodes[i]["tactile"] != 0, axis=(1, 2, 3)).sum()) for i in range(20)]
    np.testing.assert_array_equal(episodes.felt(), expected)
    assert 0 < min(expected) and max(expected) < 100
    random = Episodes(generate("box_pushing", "--episodes", "20", "--policy", "random"))
    felt = random.felt()
    assert 0 < (felt > 0).sum() < 20
    assert random.mask("touching") == list(np.flatnonzero(felt))
    both = set(random.mask("train_touching")) | set(random.mask("valid_touching"))
    assert both == set(random.mask("touching"))
    blind = Episodes(generate("box_pushing_reduced", "--episodes", "4"))
    assert blind.touch == []
    with pytest.raises(tangere.InputError, match="does not say where something is felt"):
        blind.felt()


def test_an_empty_mask_is_named(generate):
    data = generate("box_pushing", "--episodes", "2", "--policy", "random")
    for options, wanted in (
        ({"split": "valid_success"}, "mask 'valid_success'"),
        ({"split": "train", "only_success": True}, "mask 'train', those that succeeded"),
        ({"split": None, "only_success": True}, "all, those that succeeded"),
    ):
        with pytest.raises(tangere.InputError, match=f"is left to learn from of {wanted}$"):
            Windows(data, **options)
