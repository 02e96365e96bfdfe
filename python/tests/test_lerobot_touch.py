# SPDX-License-Identifier: Apache-2.0
"""Touch as policies of lerobot read it, against the HDF5 file; the card; policies that play."""

from __future__ import annotations

import json
import struct
import zlib

import h5py
import numpy as np
import pytest

import tangere

pq = pytest.importorskip("pyarrow.parquet", reason="pyarrow is not installed")
lerobot = pytest.importorskip("tangere.lerobot")


@pytest.fixture(scope="module")
def caps(generate):
    return generate("cap_opening", "--episodes", "2", "--seed", "3")


@pytest.fixture(scope="module")
def grasps(generate):
    return generate("stable_grasp", "--episodes", "3", "--seed", "3")


def rows_of(folder, name):
    return pq.read_table(folder / "data/chunk-000/file-000.parquet")[name].to_pylist()


def names_of(folder, name):
    return json.loads((folder / "meta/info.json").read_text())["features"][name]["names"]


def stored(data, key):
    with h5py.File(data / "robomimic.hdf5") as file:
        demos = file["data"]
        return np.concatenate([demos[f"demo_{i}"]["obs"][key][()] for i in range(len(demos))])


def unpacked(png):
    """Pixels of a PNG file whose lines have no filter, (height, width, 3)."""
    assert png[:8] == b"\x89PNG\r\n\x1a\n"
    at, parts = 8, {}
    while at < len(png):
        size, kind = struct.unpack(">I4s", png[at : at + 8])
        parts[kind] = png[at + 8 : at + 8 + size]
        assert struct.unpack(">I", png[at + 8 + size : at + 12 + size])[0] == zlib.crc32(
            kind + parts[kind]
        )
        at += 12 + size
    width, height, *form = struct.unpack(">IIBBBBB", parts[b"IHDR"])
    assert form == [8, 2, 0, 0, 0] and list(parts) == [b"IHDR", b"IDAT", b"IEND"]
    lines = np.frombuffer(zlib.decompress(parts[b"IDAT"]), np.uint8).reshape(height, -1)
    assert not lines[:, 0].any()
    return lines[:, 1:].reshape(height, width, 3)


def test_touch_in_vectors_is_means_over_blocks(caps, tmp_path):
    done = lerobot.export(caps, tmp_path / "out", touch="state")
    assert done.features[:2] == ["observation.state", "observation.environment_state"]
    field = stored(caps, "tactile").astype(float)  # (n, 3, 20, 20, 3)
    grid = np.array(rows_of(tmp_path / "out", "observation.environment_state"))
    names = names_of(tmp_path / "out", "observation.environment_state")
    assert grid.shape == (len(field), 3 * 7 * 7 * 3) and np.abs(grid).max() > 0
    for name, pad, rows, cols, c in (
        ("tactile[0][0][0][0]", 0, slice(0, 3), slice(0, 3), 0),
        ("tactile[2][3][1][2]", 2, slice(9, 12), slice(3, 6), 2),
        ("tactile[1][6][6][1]", 1, slice(18, 20), slice(18, 20), 1),
    ):
        wanted = field[:, pad, rows, cols, c].mean((1, 2))
        np.testing.assert_allclose(grid[:, names.index(name)], wanted, rtol=1e-6, atol=1e-12)
    state = np.array(rows_of(tmp_path / "out", "observation.state"))
    wanted = [stored(caps, "angles"), stored(caps, "tips").reshape(-1, 9), field.mean((2, 3))]
    wanted = np.concatenate([part.reshape(len(part), -1) for part in wanted], axis=1)
    np.testing.assert_allclose(state, wanted, rtol=1e-6, atol=1e-12)
    names = names_of(tmp_path / "out", "observation.state")
    assert names[9:11] == ["tips[0][0]", "tips[0][1]"] and names[-1] == "tactile.mean[2][2]"


def test_curved_pads_of_a_task_stay_apart(generate, tmp_path):
    turns = generate("in_hand", "--episodes", "2", "--seed", "1")
    lerobot.export(turns, tmp_path / "out", touch="state")
    field = stored(turns, "tactile").astype(float)  # (n, 4, 64, 3)
    grid = np.array(rows_of(tmp_path / "out", "observation.environment_state"))
    np.testing.assert_allclose(
        grid.reshape(len(field), 4, 32, 3), field.reshape(-1, 4, 32, 2, 3).mean(3), atol=1e-9
    )
    names = names_of(tmp_path / "out", "observation.state")
    state = np.array(rows_of(tmp_path / "out", "observation.state"))
    means = [k for k, name in enumerate(names) if name.startswith("tactile.mean")]
    np.testing.assert_allclose(
        state[:, means].reshape(-1, 4, 3), field.mean(2), rtol=1e-5, atol=1e-9
    )
    with pytest.raises(tangere.InputError, match="tactile"):
        lerobot.export(turns, tmp_path / "seen", touch="image")


def test_a_small_field_keeps_every_point(pushes, tmp_path):
    lerobot.export(pushes, tmp_path / "out", touch="state", privileged=True)
    grid = np.array(rows_of(tmp_path / "out", "observation.environment_state"), np.float32)
    field = stored(pushes, "tactile").reshape(len(grid), -1)
    wanted = np.concatenate([field, stored(pushes, "q"), stored(pushes, "v")], axis=1)
    np.testing.assert_array_equal(grid, wanted)


def test_pictures_are_the_field_in_the_range_that_the_file_names(pushes, tmp_path):
    lerobot.export(pushes, tmp_path / "out", touch="image")
    field = stored(pushes, "tactile").astype(float)
    files = rows_of(tmp_path / "out", "observation.images.tactile")
    pixels = np.stack([unpacked(file["bytes"]) for file in files])
    most = np.abs(field).max((0, 1, 2))
    columns = json.loads((tmp_path / "out/meta/tangere.json").read_text())["columns"]
    column = next(c for c in columns if c["dtype"] == "image")
    np.testing.assert_allclose(column["range"], most)
    np.testing.assert_array_equal(pixels, np.rint(127.5 + 127.5 * field / most))
    assert pixels.min() == 0 or pixels.max() == 255
    stats = json.loads((tmp_path / "out/meta/stats.json").read_text())
    said, unit = stats["observation.images.tactile"], pixels.reshape(-1, 3) / 255
    assert said["count"] == [len(field)] and np.shape(said["q50"]) == (3, 1, 1)
    for name, wanted in (("mean", unit.mean(0)), ("std", unit.std(0)), ("max", unit.max(0)),
                         ("q99", np.quantile(unit, 0.99, axis=0))):  # fmt: skip
        np.testing.assert_allclose(said[name], wanted[:, None, None], rtol=1e-9)
    schema = pq.read_schema(tmp_path / "out/data/chunk-000/file-000.parquet")
    features = json.loads(schema.metadata[b"huggingface"])["info"]["features"]
    assert features["observation.images.tactile"] == {"_type": "Image"}
    assert features["observation.state"]["length"] == 6 and len(features) == len(schema.names)


def test_channels_of_pads_are_told_apart(grasps, tmp_path):
    done = lerobot.export(grasps, tmp_path / "out", touch="image")
    assert done.features[:3] == [
        "observation.state", "observation.images.flow_0", "observation.images.flow_1"
    ]  # fmt: skip
    flow = stored(grasps, "flow").astype(float)  # (n, 4, 13, 10): pad, component
    most = np.abs(flow).max((0, 2, 3)).reshape(2, 2).max(0)
    for pad in (0, 1):
        files = rows_of(tmp_path / "out", f"observation.images.flow_{pad}")
        pixels = np.stack([unpacked(file["bytes"]) for file in files])
        shown = np.moveaxis(flow[:, 2 * pad : 2 * pad + 2], 1, -1)
        np.testing.assert_array_equal(pixels[..., :2], np.rint(127.5 + 127.5 * shown / most))
        assert (pixels[..., 2] == 128).all()


@pytest.fixture(scope="module")
def colours(generate, tmp_path_factory):
    """Presses of a gel with a picture of 6 × 8 pixels."""
    text = tangere.scenes()["gel_press"].read_text()
    layer = '<layer cell="0.75e-3" margin="1e-3"/>'
    varies = '<tactile name="gel" field="kn" uniform="2e8 3e8"/>'
    assert layer in text and varies in text
    press = tmp_path_factory.mktemp("scene") / "press.xml"
    press.write_text(
        text.replace(varies, "").replace(layer, layer + '<markers/><picture rows="6" cols="8"/>')
    )
    return generate(str(press), "--episodes", "2", "--seed", "4", "--every", "25",
                    "--record", "q,v,gel,gel.rgb")  # fmt: skip


@pytest.mark.parametrize("touch", [None, "state", "image"])
def test_colours_of_a_gel_are_written_as_they_are(colours, tmp_path, touch):
    done = lerobot.export(colours, tmp_path / "out", touch=touch)
    assert [name for name in done.features if "rgb" in name] == ["observation.images.gel.rgb"]
    rgb = stored(colours, "gel.rgb")
    assert rgb.dtype == np.uint8 and rgb.shape[1:] == (6, 8, 3) and len(np.unique(rgb)) > 10
    files = rows_of(tmp_path / "out", "observation.images.gel.rgb")
    np.testing.assert_array_equal(np.stack([unpacked(file["bytes"]) for file in files]), rgb)
    columns = json.loads((tmp_path / "out/meta/tangere.json").read_text())["columns"]
    column = next(c for c in columns if c["name"] == "observation.images.gel.rgb")
    assert column["dtype"] == "image" and "range" not in column
    info = json.loads((tmp_path / "out/meta/info.json").read_text())
    said = info["features"]["observation.images.gel.rgb"]
    assert said["shape"] == [6, 8, 3] and said["names"] == ["height", "width", "channels"]
    others = [c for c in columns if c["name"].startswith("observation.")]
    assert [c["keys"] for c in others if "gel.rgb" in c["keys"]] == [["gel.rgb"]]


def test_colours_alone_are_no_touch(colours, tmp_path):
    from tangere._export_frames import Frames
    from tangere._lerobot_features import features_of
    from tangere.data import Episodes

    episodes = Episodes(colours)
    episodes.keys = ["gel.rgb"]
    episodes.touch, episodes.privileged = [], []
    frames = Frames(episodes, [0])
    assert [f.name for f in features_of(frames, False, None)][:1] == [
        "observation.images.gel.rgb"
    ]  # fmt: skip
    with pytest.raises(tangere.InputError, match="that is no picture in colours"):
        features_of(frames, False, "image")


def test_touch_that_cannot_be_written_is_refused(generate, pushes, tmp_path, capsys):
    bare = generate("dummy", "--episodes", "1")
    for data, touch, message in (
        (pushes, "sound", "touch 'sound'; expected None, 'state' or 'image'"),
        (bare, "state", "without a reading of a sensor"),
    ):
        with pytest.raises(tangere.InputError, match=message):
            lerobot.export(data, tmp_path / "out", touch=touch)
    from tangere import _lerobot_features as features

    assert features._least_block((2000, 3)) == 10  # a curved pad
    means = features.block_means(np.arange(14.0).reshape(1, 7, 2), 3)
    np.testing.assert_array_equal(means, [[[2, 3], [8, 9], [12, 13]]])
    assert lerobot.main([str(bare), str(tmp_path / "out"), "--touch", "image"]) == 2
    assert "without a reading" in capsys.readouterr().err and not (tmp_path / "out").exists()


def test_the_command_names_what_policies_do_not_read(pushes, tmp_path, capsys):
    hidden = (
        "note: left out, because a robot could not measure them: q, v; "
        "--privileged writes them\n"
    )
    for words, note in (
        ([], hidden + "note: policies of lerobot do not read observation.tactile; see --touch\n"),
        (["--touch", "state"], hidden),
        (["--touch", "image", "--privileged"], ""),
    ):
        assert lerobot.main([str(pushes), str(tmp_path / "out"), "--overwrite", *words]) == 0
        assert capsys.readouterr().err == note


def test_the_card_says_what_is_there(pushes, tmp_path):
    lerobot.export(pushes, tmp_path / "out", touch="image", license="cc0-1.0")
    _, head, text = (tmp_path / "out/README.md").read_text().split("---\n", 2)
    said = dict(line.split(": ", 1) for line in head.splitlines() if ": " in line)
    assert json.loads(said["license"]) == "cc0-1.0" and said["- config_name"] == "default"
    assert said["task_categories"] == "[robotics]" and "tactile" in json.loads(said["tags"])
    assert len(list((tmp_path / "out").glob(said["  data_files"]))) == 1
    for part in ("tangere generate box_pushing --episodes 20 --seed 5", "20 episodes with 2000",
                 "13 × 10 points", "`observation.images.tactile`, (13, 10, 3) image",
                 "[N]", f"Tangere {tangere.__version__}"):  # fmt: skip
        assert part in text, part


def test_the_package_datasets_reads_the_folder(pushes, tmp_path):
    datasets = pytest.importorskip("datasets", reason="datasets is not installed")
    for touch in (None, "state", "image"):
        folder = tmp_path / str(touch)
        lerobot.export(pushes, folder, touch=touch)
        read = datasets.load_dataset(str(folder), cache_dir=str(tmp_path / "cache"), split="train")
        info = json.loads((folder / "meta/info.json").read_text())
        assert len(read) == info["total_frames"] and set(read[0]) == set(info["features"])
    file = rows_of(folder, "observation.images.tactile")[40]
    shown = np.asarray(read[40]["observation.images.tactile"])
    np.testing.assert_array_equal(shown, unpacked(file["bytes"]))


class Recorded:
    """The actions of a data set as a policy, which compares what it is shown at each start."""

    def __init__(self, data, folder):
        with h5py.File(data / "robomimic.hdf5") as file:
            demos = [file[f"data/demo_{i}"] for i in range(len(file["data"]))]
            self.actions = [demo["actions"][()] for demo in demos]
            self.returns = [demo.attrs["return"] for demo in demos]
            self.solved = [demo.attrs["success"] for demo in demos]
        self.starts = np.concatenate([[0], np.cumsum([len(a) for a in self.actions])])
        self.state = rows_of(folder, "observation.state")
        self.rest = rows_of(folder, "observation.images.tactile")
        self.first, self.t, self.groups = -2, 0, 0

    def reset(self):
        self.first, self.t, self.groups = self.first + 2, 0, self.groups + 1

    def __call__(self, frames):
        envs = range(len(frames["observation.state"]))
        chosen = [self.first + e for e in envs]
        for e, episode in zip(envs, chosen, strict=True):
            at = self.starts[episode] + self.t
            if self.t == 0:
                wanted = np.float32(self.state[at])
                np.testing.assert_array_equal(frames["observation.state"][e], wanted)
            shown = frames["observation.images.tactile"][e].astype(int)
            assert np.abs(shown - unpacked(self.rest[at]["bytes"])).max() <= 1
        self.t += 1
        return np.stack([self.actions[episode][self.t - 1] for episode in chosen])


def test_a_policy_plays_what_the_export_shows(pushes, tmp_path):
    lerobot.export(pushes, tmp_path / "out", touch="image")
    policy = Recorded(pushes, tmp_path / "out")
    found = lerobot.play(policy, tmp_path / "out", 4, seed=5, num_envs=2)
    assert policy.groups == 2 and found["task"] == "box_pushing" and found["mean_actions"] == 100
    assert found["successes"] == sum(policy.solved[:4])
    assert found["mean_return"] == pytest.approx(np.mean(policy.returns[:4]), rel=1e-3)
    assert found["interval"][0] < found["success_rate"] <= found["interval"][1] <= 1
    with pytest.raises(tangere.InputError, match="actions"):
        lerobot.play(lambda frames: np.zeros((2, 7)), tmp_path / "out", 2)


def test_what_cannot_be_played_is_refused(generate, pushes, tmp_path):
    balls = generate(str(tangere.scenes()["rolling_ball_small"]), "--episodes", "2", "--steps",
                     "20", "--every", "5", "--record", "q,pad")  # fmt: skip
    lerobot.export(balls, tmp_path / "balls", touch="state")
    still = lambda frames: np.zeros((2, 3))  # noqa: E731
    with pytest.raises(tangere.InputError, match="of a scene"):
        lerobot.play(still, tmp_path / "balls", 2)
    with pytest.raises(tangere.InputError, match="the task does not show \\['pad'\\]"):
        lerobot.play(still, tmp_path / "balls", 2, task="stable_grasp")
    with pytest.raises(tangere.InputError, match="expected a folder that export has written"):
        lerobot.play(still, pushes, 2)


def test_a_checkpoint_of_lerobot_plays(pushes, tmp_path):
    pytest.importorskip("lerobot", reason="lerobot is not installed")
    from lerobot.datasets.lerobot_dataset import LeRobotDatasetMetadata
    from lerobot.datasets.utils import dataset_to_policy_features
    from lerobot.policies.act.configuration_act import ACTConfig
    from lerobot.policies.act.modeling_act import ACTPolicy
    from lerobot.policies.factory import make_pre_post_processors

    for touch in ("state", "image"):
        data = tmp_path / touch
        lerobot.export(pushes, data, touch=touch)
        meta = LeRobotDatasetMetadata("local/data", root=data)
        features = dataset_to_policy_features(meta.features)
        config = ACTConfig(
            output_features={"action": features.pop("action")}, input_features=features,
            chunk_size=4, n_action_steps=2, dim_model=32, n_heads=2, dim_feedforward=32,
            pretrained_backbone_weights=None, device="cpu",
        )  # fmt: skip
        parts = (ACTPolicy(config), *make_pre_post_processors(config, dataset_stats=meta.stats))
        for part in parts:
            part.save_pretrained(tmp_path / f"{touch}_act")
        found = lerobot.play(tmp_path / f"{touch}_act", data, 4, num_envs=2)
        assert found["episodes"] == 4 and found["mean_actions"] == 100
    with pytest.raises(tangere.InputError, match="expected a checkpoint of lerobot"):
        lerobot.Checkpoint(tmp_path)
    with pytest.raises(tangere.InputError, match="the policy reads 'observation.environment"):
        lerobot.play(tmp_path / "state_act", tmp_path / "image", 2)


class Press(tangere.VectorSceneEnv):
    """An action presses a pad onto a ball; with touch in the last row the task is solved."""

    scene, steps_per_action, horizon, actions = tangere.scenes()["rolling_ball_small"], 10, 8, 1
    touch = ["pad"]

    def controls(self, actions):
        return np.concatenate([np.zeros((self.num_envs, 2)), -0.2 * np.abs(actions)], axis=1)

    def observe(self):
        return {"pad": self.batch.tactile("pad"), "time": self.lengths[:, None] / self.horizon}

    def reward(self, actions):
        return -np.abs(actions[:, 0])

    def success(self):
        return np.abs(self.batch.tactile("pad")).max((1, 2, 3)) > 0


def test_a_task_in_python_is_exported_and_played(tmp_path):
    import tangere.data

    def always(obs, episodes, actions):
        return np.ones((len(episodes), 1))

    said = tangere.data.generate(Press, tmp_path / "set", 4, policy=always)
    assert said["success_rate"] == 1
    lerobot.export(tmp_path / "set", tmp_path / "out", touch="state", privileged=True)
    model = tangere.Model(tangere.Scene(Press.scene))
    shown = []

    def on(frames):
        shown.append(frames)
        return np.ones((len(frames["observation.state"]), 1))

    found = lerobot.play(on, tmp_path / "out", 3, task=Press, seed=7)
    assert found["task"] == "Press" and found["successes"] == 3 and found["mean_return"] == -8
    assert {name: rows.shape for name, rows in shown[0].items()} == {
        "observation.state": (3, 1 + 3),
        "observation.environment_state": (3, 363 + model.nq + model.nv),
    }
    with pytest.raises(tangere.InputError, match="expected its class"):
        lerobot.play(on, tmp_path / "out", 2)
