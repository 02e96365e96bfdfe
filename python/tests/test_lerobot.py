# SPDX-License-Identifier: Apache-2.0
"""A LeRobot data set against the HDF5 file it was made of, read with pyarrow and h5py alone."""

from __future__ import annotations

import fcntl
import filecmp
import json
import shutil

import h5py
import numpy as np
import pytest

import tangere

pa = pytest.importorskip("pyarrow", reason="pyarrow is not installed")
pq = pytest.importorskip("pyarrow.parquet", reason="pyarrow is not installed")
lerobot = pytest.importorskip("tangere.lerobot")


def frames_of(folder):
    """KEY → rows of all files of frames, in the order of their names."""
    info = json.loads((folder / "meta/info.json").read_text())
    table = pa.concat_tables(
        [pq.read_table(path) for path in sorted(folder.glob("data/*/*.parquet"))]
    )
    return info, {
        name: np.asarray(table[name].to_pylist()).reshape(-1, *said["shape"])
        for name, said in info["features"].items()
    }


def same_files(a, b):
    names = sorted(path.relative_to(a) for path in a.rglob("*") if path.is_file())
    assert names == sorted(path.relative_to(b) for path in b.rglob("*") if path.is_file())
    return filecmp.cmpfiles(a, b, names, shallow=False)[0] == names


@pytest.fixture(scope="module")
def exported(pushes, tmp_path_factory):
    folder = tmp_path_factory.mktemp("lerobot") / "pushes"
    return lerobot.export(pushes, folder, privileged=True), folder


def test_every_number_is_that_of_the_file(pushes, exported):
    done, folder = exported
    info, rows = frames_of(folder)
    with h5py.File(pushes / "robomimic.hdf5") as file:
        demos = [file[f"data/demo_{i}"] for i in range(len(file["data"]))]
        wanted = {
            "observation.state": [d["obs/goal"][()] for d in demos],
            "observation.tactile": [d["obs/tactile"][()] for d in demos],
            "observation.environment_state": [
                np.concatenate([d["obs/q"][()], d["obs/v"][()]], axis=1) for d in demos
            ],
            "action": [d["actions"][()] for d in demos],
            "next.reward": [d["rewards"][()][:, None] for d in demos],
            "next.done": [d["dones"][()][:, None] for d in demos],
        }
        success = [np.zeros((len(d["actions"]), 1), bool) for d in demos]
        for ends, demo in zip(success, demos, strict=True):
            ends[-1] = demo.attrs["success"]
    wanted["next.success"] = success
    for name, parts in wanted.items():
        np.testing.assert_array_equal(rows[name], np.concatenate(parts), err_msg=name)
    assert np.abs(rows["observation.tactile"]).max() > 0 and 0 < rows["next.success"].sum() < 20
    lengths = [len(part) for part in wanted["action"]]
    frame = np.concatenate([np.arange(n) for n in lengths])[:, None]
    np.testing.assert_array_equal(rows["frame_index"], frame)
    np.testing.assert_array_equal(rows["timestamp"], np.float32(frame / 40))
    np.testing.assert_array_equal(rows["index"][:, 0], np.arange(sum(lengths)))
    np.testing.assert_array_equal(rows["episode_index"][:, 0], np.repeat(range(20), lengths))
    assert set(rows) == set(wanted) | {
        "timestamp", "frame_index", "episode_index", "index", "task_index"
    }  # fmt: skip
    assert (done.episodes, done.frames, done.fps) == (20, sum(lengths), 40)
    assert info["codebase_version"] == "v3.0" and info["fps"] == 40
    assert (info["total_episodes"], info["total_frames"]) == (20, sum(lengths))
    assert info["splits"] == {"train": "0:20"}
    assert info["features"]["observation.tactile"]["shape"] == [13, 10, 3]
    assert info["features"]["observation.state"]["names"] == ["goal[0]", "goal[1]", "goal[2]"]
    names = info["features"]["observation.environment_state"]["names"]
    assert names[0] == "hand_turn.angle" and len(names) == 14


def test_what_a_robot_cannot_see_stays_away_unless_asked_for(pushes, tmp_path):
    done = lerobot.export(pushes, tmp_path / "out")
    assert done.features == [
        "observation.state", "observation.tactile", "action", "next.reward", "next.done",
        "next.success",
    ]  # fmt: skip
    assert not any("environment" in p.read_text() for p in tmp_path.glob("out/meta/*.json"))


def test_statistics_are_those_of_the_frames(exported):
    _, folder = exported
    _, rows = frames_of(folder)
    stats = json.loads((folder / "meta/stats.json").read_text())
    assert stats.keys() == rows.keys()
    episodes = pq.read_table(folder / "meta/episodes/chunk-000/file-000.parquet").to_pylist()
    for name, values in rows.items():
        parts = [values[e["dataset_from_index"] : e["dataset_to_index"]] for e in episodes]
        found = [{k.rsplit("/", 1)[1]: v for k, v in e.items() if k.startswith(f"stats/{name}/")}
                 for e in episodes]  # fmt: skip
        for part, said in zip([values, *parts], [stats[name], *found], strict=True):
            flat = part.reshape(-1, part.shape[-1]).astype(float)
            assert said["count"] == [len(part)]
            np.testing.assert_array_equal(said["min"], flat.min(0))
            np.testing.assert_array_equal(said["max"], flat.max(0))
            close = {"rtol": 1e-9, "atol": 1e-12 * max(1, np.abs(flat).max())}
            np.testing.assert_allclose(said["mean"], flat.mean(0), **close)
            np.testing.assert_allclose(said["std"], flat.std(0), **close)
            np.testing.assert_allclose(said["q10"], np.quantile(flat, 0.1, axis=0), **close)


def test_a_sample_of_many_frames_is_evenly_spaced(monkeypatch):
    from tangere import _lerobot_statistics as statistics
    from tangere._lerobot_features import Feature

    monkeypatch.setattr(statistics, "SAMPLE", 30)
    feature = Feature("x", ["x"], (1,))
    rows = np.arange(100.0)[:, None]
    parts = []
    for first, last in ((0, 50), (50, 100)):
        part = statistics.Statistics(feature, 100, first)
        for episode in np.split(rows[first:last], [7, 9]):
            part.add(episode)
        parts.append(part.packed())
    found = statistics.of_all(feature, statistics.joined(parts))
    kept = rows[::4]  # 100 numbers, at most 30 of them
    assert found["q50"] == [np.quantile(kept, 0.5)]
    assert found["max"] == [99.0] and found["mean"] == [49.5] and found["count"] == [100]
    np.testing.assert_allclose(found["std"], [rows.std()])


def test_quantiles_are_those_of_numpy():
    from tangere import _lerobot_statistics as statistics

    rng = np.random.default_rng(3)
    wanted = list(statistics.QUANTILES.values())
    for share in (0, 0.02, 0.5, 1):  # of numbers that are not 0
        rows = rng.normal(size=(3000, 3)).astype(np.float32)
        rows[rng.random(rows.shape) >= share] = 0
        found = statistics.quantiles(rows)
        np.testing.assert_allclose(found, np.quantile(rows.astype(float), wanted, axis=0))
    picture = rng.integers(0, 256, (5, 20, 30, 3)).astype(np.uint8)
    as_bytes, as_numbers = statistics.moments(picture), statistics.moments(picture.astype(float))
    for name, values in as_numbers.items():
        np.testing.assert_allclose(as_bytes[name], values, rtol=1e-12)


def test_episodes_say_where_they_lie(pushes, tmp_path, exported):
    lerobot.export(pushes, tmp_path / "small", privileged=True, file_megabytes=0.1)
    files = sorted(tmp_path.glob("small/data/*/*.parquet"))
    assert len(files) == 20  # an episode has 0.16 MB
    table = pq.read_table(tmp_path / "small/meta/episodes/chunk-000/file-000.parquet")
    for row in table.to_pylist():
        chunk, number = row["data/chunk_index"], row["data/file_index"]
        path = tmp_path / f"small/data/chunk-{chunk:03d}/file-{number:03d}.parquet"
        held = pq.read_table(path, columns=["episode_index", "index"]).to_pydict()
        index = [i for i, e in zip(held["index"], held["episode_index"], strict=True)
                 if e == row["episode_index"]]  # fmt: skip
        assert index == list(range(row["dataset_from_index"], row["dataset_to_index"]))
        assert row["length"] == len(index) and len(row["tasks"]) == 1
    many, one = frames_of(tmp_path / "small")[1], frames_of(exported[1])[1]
    for name, values in one.items():
        np.testing.assert_array_equal(many[name], values)


def test_the_same_set_gives_the_same_bytes(generate, pushes, tmp_path, exported):
    shards = generate("box_pushing", "--episodes", "20", "--seed", "5", "--threads", "1",
                      "--shards", "2")  # fmt: skip
    for folder, name in ((pushes / "robomimic.hdf5", "merged"), (shards, "shards")):
        lerobot.export(folder, tmp_path / name, privileged=True)
    assert same_files(tmp_path / "merged", exported[1])
    # Which command made it is all that differs.
    for name in ("meta/tangere.json", "README.md"):
        (tmp_path / "shards" / name).unlink()
        (tmp_path / "merged" / name).unlink()
    assert same_files(tmp_path / "merged", tmp_path / "shards")


def test_masks_choose_episodes(pushes, tmp_path):
    with h5py.File(pushes / "robomimic.hdf5") as file:
        solved = [name.decode() for name in file["mask/train_success"]]
    done = lerobot.export(pushes, tmp_path / "some", mask="train", only_success=True)
    origin = json.loads((tmp_path / "some/meta/tangere.json").read_text())
    assert origin["demos"] == solved and done.episodes == len(solved) > 0
    with pytest.raises(tangere.InputError, match="no mask 'good'; it has"):
        lerobot.export(pushes, tmp_path / "none", mask="good")
    assert not (tmp_path / "none").exists()


def test_scenes_and_slow_actions(generate, tmp_path, capsys):
    balls = generate(str(tangere.scenes()["rolling_ball_small"]), "--episodes", "2", "--steps",
                     "20", "--every", "5", "--record", "q,pad,pad.sum")  # fmt: skip
    done = lerobot.export(balls, tmp_path / "balls")
    assert done.features == [
        "observation.state", "observation.pad", "action", "next.reward", "next.done"
    ]  # fmt: skip
    info, rows = frames_of(tmp_path / "balls")
    state = info["features"]["observation.state"]["names"]
    assert state[:4] == ["pad_joint.x", "pad_joint.y", "pad_joint.z", "pad.sum[0]"]
    with h5py.File(balls / "shard-00000.h5") as file:
        np.testing.assert_array_equal(rows["observation.pad"][4:], file["data/demo_1/obs/pad"])
    grasps = generate("stable_grasp", "--episodes", "3")
    assert lerobot.main([str(grasps), str(tmp_path / "grasps"), "--json"]) == 0
    said = json.loads(capsys.readouterr().out)
    assert said["fps"] == 1 and said["seconds_per_action"] == pytest.approx(0.9)


def test_nothing_half_written_gets_the_name(pushes, spoil, tmp_path, monkeypatch):
    out = tmp_path / "out"
    copy = tmp_path / "damaged"
    shutil.copytree(pushes, copy)
    spoil(copy)
    with pytest.raises(tangere.InputError, match="demo_7 has a number in 'observation.tactile'"):
        lerobot.export(copy, out)
    assert [path.name for path in tmp_path.iterdir()] == ["damaged"]
    lerobot.export(pushes, out)
    before = sorted(out.rglob("*"))
    with pytest.raises(tangere.IoError, match="exists already"):
        lerobot.export(pushes, out)
    with pytest.raises(tangere.InputError, match="demo_7"):
        lerobot.export(copy, out, overwrite=True)
    assert sorted(out.rglob("*")) == before  # the old one is still there
    (tmp_path / "out.part/data").mkdir(parents=True)  # what a killed run leaves
    (tmp_path / "out.part/data/left").touch()
    (tmp_path / "out.part/.lock").touch()
    lerobot.export(pushes, out, overwrite=True, mask="valid")
    assert not list(out.rglob("left")) and not (out / ".lock").exists()
    assert sorted(path.name for path in tmp_path.iterdir()) == ["damaged", "out"]
    out.rename(tmp_path / "out.old.part")  # as a run that was killed between two names left it
    with pytest.raises(tangere.InputError, match="demo_7"):
        lerobot.export(copy, out, overwrite=True)
    assert (out / "meta/info.json").is_file() and not (tmp_path / "out.old.part").exists()
    out.rename(tmp_path / "out.old.part")
    with pytest.raises(tangere.IoError, match="exists already"):
        lerobot.export(pushes, out)
    assert (out / "meta/info.json").is_file()
    half = tmp_path / "out.old.part"  # a run that was killed while it removed the old one
    shutil.copytree(out, half)
    (half / "meta/info.json").unlink()
    shutil.rmtree(out)
    lerobot.export(pushes, out)
    assert (out / "meta/info.json").is_file() and not half.exists()
    inside = out / "shards"
    shutil.copytree(pushes, inside)
    with pytest.raises(tangere.InputError, match="holds the input"):
        lerobot.export(inside, out, overwrite=True)
    assert inside.is_dir()
    mine = tmp_path / "mine"
    mine.mkdir()
    with pytest.raises(tangere.InputError, match="no LeRobot data set"):
        lerobot.export(pushes, mine, overwrite=True)
    part = tmp_path / "held.part"
    part.mkdir()
    with open(part / ".lock", "w") as lock:
        fcntl.flock(lock, fcntl.LOCK_EX)
        with pytest.raises(tangere.InputError, match="by another process"):
            lerobot.export(pushes, tmp_path / "held")

    def fail(*_):
        raise OSError(28, "full")

    monkeypatch.setattr("tangere._lerobot_format.write_task", fail)
    assert lerobot.main([str(pushes), str(tmp_path / "full")]) == 3
    assert not list(tmp_path.glob("full*"))


def test_names_that_mean_something_else_are_refused(pushes, tmp_path, capsys):
    copy = tmp_path / "copy.h5"
    for name, message in (("success", "called 'success'"), ("index", "called 'index'"),
                          ("state", "called 'state'")):  # fmt: skip
        shutil.copy(pushes / "shard-00000.h5", copy)
        with h5py.File(copy, "r+") as file:
            file["scene"].attrs["observations"] = ["goal", name]
            for demo in file["data"].values():
                demo["obs"].move("tactile", name)
        with pytest.raises(tangere.InputError, match=message):
            lerobot.export(copy, tmp_path / "out")
    shutil.copy(pushes / "shard-00000.h5", copy)
    with h5py.File(copy, "r+") as file:
        del file["data/demo_3/obs/goal"]
    assert lerobot.main([str(copy), str(tmp_path / "out")]) == 3
    assert "goal" in capsys.readouterr().err and not (tmp_path / "out").exists()


def test_the_command_tells_mistakes(tmp_path, capsys, pushes):
    for arguments, code, message in [
        ([str(tmp_path), "out"], 3, "no shard-"),
        ([str(tmp_path / "none"), "out"], 3, "it does not exist"),
        ([str(pushes), str(tmp_path / "out"), "--fps", "0"], 2, "fps 0"),
        ([str(pushes / "minari"), "out"], 3, "no shard-"),
    ]:
        assert lerobot.main(arguments) == code
        assert message in capsys.readouterr().err
    not_ours = tmp_path / "other.h5"
    with h5py.File(not_ours, "w"):
        pass
    assert lerobot.main([str(not_ours), str(tmp_path / "out")]) == 3
    assert "no file of `tangere generate`" in capsys.readouterr().err
