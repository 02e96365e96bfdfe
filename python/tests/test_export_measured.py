# SPDX-License-Identifier: Apache-2.0
"""What a robot measures: joints with motors are state, the rest is privileged, in every format."""

from __future__ import annotations

import functools
import json

import h5py
import numpy as np
import pytest

import tangere
from tangere import export as exports
from tangere.data import Episodes, Windows

pq = pytest.importorskip("pyarrow.parquet", reason="pyarrow is not installed")
zarr = pytest.importorskip("zarr", reason="zarr is not installed")
pytest.importorskip("PIL.Image", reason="pillow is not installed")

export = functools.partial(exports.export, workers=1)
PAD = ["pad_joint.x", "pad_joint.y", "pad_joint.z"]


@pytest.fixture(scope="module")
def balls(generate):
    """A pad with motors rolls a ball that is free; both move."""
    return generate(str(tangere.scenes()["rolling_ball_small"]), "--episodes", "2", "--steps",
                    "60", "--every", "10", "--record", "q,v,pad.sum,bodies.ball")  # fmt: skip


@pytest.fixture(scope="module")
def rows(balls):
    """KEY → rows of both episodes."""
    with h5py.File(balls / "shard-00000.h5") as file:
        demos = [file["data/demo_0"], file["data/demo_1"]]
        keys = [f"obs/{key}" for key in demos[0]["obs"]]
        return {key.removeprefix("obs/"): np.concatenate([demo[key][()] for demo in demos])
                for key in keys}  # fmt: skip


def test_data_sets_say_it(balls):
    assert Windows(balls).keys == ["pad.sum"]
    with h5py.File(balls / "shard-00000.h5") as file:
        scene = file["scene"].attrs
        assert json.loads(scene["privileged"]) == ["q", "v", "bodies.ball"]
        assert json.loads(scene["actuated_joints"]) == ["pad_joint"]
    episodes = Episodes(balls)
    assert episodes.measured("q") == [0, 1, 2] == episodes.measured("v")
    assert episodes.measured("bodies.ball") == []


@pytest.mark.parametrize("privileged", [False, True])
def test_lerobot_splits_q_and_v(balls, rows, tmp_path, privileged):
    done = export(balls, tmp_path / "out", privileged=privileged)
    info = json.loads((tmp_path / "out/meta/info.json").read_text())["features"]
    table = pq.read_table(tmp_path / "out/data/chunk-000/file-000.parquet")

    def column(name):
        return np.stack(table[name].to_numpy())

    state = info["observation.state"]["names"]
    assert state[:6] == PAD + ["pad_joint.vx", "pad_joint.vy", "pad_joint.vz"]
    assert len(state) == 12  # and the sum of the pad
    wanted = np.hstack([rows["q"][:, :3], rows["v"][:, :3], rows["pad.sum"]])
    np.testing.assert_array_equal(column("observation.state"), wanted.astype(np.float32))
    card = (tmp_path / "out/README.md").read_text()
    assert "`q` of joints with a motor: pad_joint.x, pad_joint.y, pad_joint.z" in card
    hidden = "q of ball_joint; v of ball_joint; bodies.ball"
    left_out = [note for note in done.notes if note.startswith("left out")]
    assert (f"Left out, because a robot could not measure them: {hidden}." in card) != privileged
    assert len(left_out) == (not privileged) and (privileged or hidden in left_out[0])
    assert ("observation.environment_state" in info) == privileged
    if privileged:
        wanted = np.hstack(
            [rows["q"][:, 3:], rows["v"][:, 3:], rows["bodies.ball"].reshape(len(rows["q"]), -1)]
        )
        found = column("observation.environment_state")
        np.testing.assert_array_equal(found, wanted.astype(np.float32))
        assert "`q` of joints without a motor: ball_joint.x" in card


def test_zarr_splits_q_and_v(balls, rows, tmp_path):
    export(balls, tmp_path / "less", "zarr")
    export(balls, tmp_path / "all", "zarr", privileged=True)
    less, whole = (zarr.open_group(str(tmp_path / n), mode="r") for n in ("less", "all"))
    assert {*dict(less["data"].arrays())} == {"q", "v", "pad.sum", "action", "reward", "done"}
    assert less.attrs["privileged"] == []
    assert whole.attrs["privileged"] == ["q_privileged", "v_privileged", "bodies.ball"]
    for root in (less, whole):
        np.testing.assert_array_equal(root["data/q"][:], rows["q"][:, :3])
        assert root["data/q"].attrs["names"] == PAD and root["data/q"].attrs["units"] == ["m"] * 3
    np.testing.assert_array_equal(whole["data/q_privileged"][:], rows["q"][:, 3:])
    np.testing.assert_array_equal(whole["data/v_privileged"][:], rows["v"][:, 3:])
    assert whole["data/q_privileged"].attrs["names"][0] == "ball_joint.x"


def test_univtac_has_the_joints_of_motors(balls, rows, tmp_path, generate):
    export(balls, tmp_path / "out", "univtac", privileged=True)
    said = json.loads((tmp_path / "out/metadata.json").read_text())
    assert said["joints"] == PAD
    with h5py.File(tmp_path / "out/hdf5/1.hdf5") as file:
        np.testing.assert_array_equal(file["embodiment/joint"], np.float32(rows["q"][6:, :3]))
        np.testing.assert_array_equal(file["q"], np.float32(rows["q"][6:]))
    export(balls, tmp_path / "plain", "univtac")
    with h5py.File(tmp_path / "plain/hdf5/0.hdf5") as file:
        assert "q" not in file
    text = tangere.scenes()["rolling_ball_small"].read_text()
    start, end = text.index("<actuator>"), text.index("</actuator>") + len("</actuator>")
    text = text[:start] + text[end:]
    start, end = text.index("<control>"), text.index("</control>") + len("</control>")
    (tmp_path / "still.xml").write_text(text[:start] + text[end:])
    still = generate(str(tmp_path / "still.xml"), "--episodes", "1", "--steps", "20", "--every",
                     "10", "--record", "q,pad")  # fmt: skip
    with pytest.raises(tangere.InputError, match="no joint has a motor; expected joints .* of pad"):
        export(still, tmp_path / "none", "univtac")
    export(still, tmp_path / "named", "univtac", joints="pad_joint.z")
    with pytest.raises(tangere.InputError, match="no motor, so no action; expected"):
        export(still, tmp_path / "lerobot")
    export(still, tmp_path / "zarr", "zarr", privileged=True)
    whole = zarr.open_group(str(tmp_path / "zarr"), mode="r")
    assert whole["data/q"].shape[1] == 10 and whole.attrs["privileged"] == ["q"]


def test_a_task_declares_what_it_shows(pushes, generate, tmp_path):
    done = export(pushes, tmp_path / "out", "zarr")
    assert "q" not in dict(zarr.open_group(str(tmp_path / "out"), mode="r")["data"].arrays())
    assert "because a robot could not measure them: q, v; --privileged" in done.notes[0]
    done = export(generate("stable_grasp", "--episodes", "2"), tmp_path / "uv", "univtac")
    said = json.loads((tmp_path / "uv/metadata.json").read_text())
    assert "tactile/flow/force" not in said["datasets"]  # its unit is 1, no force
    assert "left out, because UniVTAC has no place for it: v, flow" in done.notes
    joints = said["joints"]
    hand = ["hand_slide.x", "hand_slide.y", "hand_slide.z", "hand_turn.angle"]
    assert joints == hand + ["left_finger.position", "right_finger.position"]  # not of the bar
