# SPDX-License-Identifier: Apache-2.0
"""Windows of touch in the rows of a data set, as `Episodes`, `Windows` and exports show them."""

from __future__ import annotations

import json

import h5py
import numpy as np
import pytest

import tangere
from tangere import export as exports
from tangere.data import Episodes, Windows

zarr = pytest.importorskip("zarr", reason="zarr is not installed")


@pytest.fixture(scope="module")
def pushes_with_touch(generate):
    """Three episodes of box pushing, with the five readings of each action."""
    return generate("box_pushing", "--episodes", "3", "--seed", "5", "--record",
                    "q,v,goal,tactile,pad/1,pad.sum/1")  # fmt: skip


def stored(data, key):
    with h5py.File(data / "robomimic.hdf5") as file:
        return np.concatenate([demo[key][()] for _, demo in sorted(file["data"].items())])


def test_episodes_have_them(pushes_with_touch):
    episodes = Episodes(pushes_with_touch)
    assert episodes.windows == {"pad": 0.005, "pad.sum": 0.005}
    assert {"pad", "pad.sum"} <= {*episodes.touch} and "pad" not in episodes.privileged
    first = episodes[0]
    assert first["pad"].shape == (100, 5, 13, 10, 3) and first["pad.sum"].shape == (100, 5, 6)
    np.testing.assert_array_equal(first["pad"][:, -1], first["tactile"])
    assert episodes.final(0)["pad"].shape == (1, 5, 13, 10, 3)
    moved = np.abs(np.diff(first["pad"], axis=1)).max(axis=(2, 3, 4))
    assert (moved[np.abs(first["pad"]).max(axis=(1, 2, 3, 4)) > 0] > 0).any()


@pytest.mark.parametrize(
    "form, shape", [("stored", (5, 13, 10, 3)), ("image", (3, 5, 13, 10)), ("points", (5, 130, 3))]
)
def test_windows_of_rows_have_them_in_every_form(pushes_with_touch, form, shape):
    windows = Windows(pushes_with_touch, ["pad", "pad.sum"], before=1, form=form, split=None)
    obs = windows[60]["obs"]
    assert obs["pad"].shape == (2, *shape) and obs["pad.sum"].shape == (2, 5, 6)
    wanted = windows.episodes[0]["pad"][59:61]
    if form == "image":
        wanted = np.moveaxis(wanted, -1, 1)
    np.testing.assert_array_equal(obs["pad"], wanted.reshape(2, *shape))


def test_formats_have_every_reading(pushes_with_touch, tmp_path):
    pq = pytest.importorskip("pyarrow.parquet", reason="pyarrow is not installed")
    data, pad = pushes_with_touch, stored(pushes_with_touch, "obs/pad")
    exports.export(data, tmp_path / "zarr", "zarr")
    array = zarr.open_group(str(tmp_path / "zarr"), mode="r")["data/pad"]
    np.testing.assert_array_equal(array[:], pad)
    assert array.attrs["unit"] == "N"
    assert array.attrs["window"] == {"readings": 5, "seconds": 0.005}
    exports.export(data, tmp_path / "lerobot", "lerobot")
    info = json.loads((tmp_path / "lerobot/meta/info.json").read_text())
    assert info["features"]["observation.pad"]["shape"] == [5, 13, 10, 3]
    rows = pq.read_table(tmp_path / "lerobot/data/chunk-000/file-000.parquet")["observation.pad"]
    np.testing.assert_array_equal(np.asarray(rows.to_pylist(), np.float32), pad)
    said = json.loads((tmp_path / "lerobot/meta/tangere.json").read_text())
    assert said["windows"]["pad.sum"] == {"readings": 5, "seconds": 0.005}
    card = (tmp_path / "lerobot/README.md").read_text()
    assert "`pad`, `pad.sum`: 5 samples a frame along the first axis, 0.005 s apart" in card
    exports.export(data, tmp_path / "ftp1", "ftp1")
    group = zarr.open_group(str(tmp_path / "ftp1/data"), mode="r")["right_tactile_data_pad"]
    np.testing.assert_array_equal(group[:], np.concatenate([*np.moveaxis(pad, 1, 0)], -1)[:, None])
    said = {name: zarr.open_group(str(tmp_path / "ftp1/data"))[f"right_tactile_{name}"][0]
            for name in ("type_pad", "type_pad_sum", "data_pad_sum")}  # fmt: skip
    assert said["type_pad"] == "matrix" and said["type_pad_sum"] == "state"
    np.testing.assert_array_equal(said["data_pad_sum"][0], stored(data, "obs/pad.sum")[0].ravel())
    with pytest.raises(tangere.InputError, match="touch 'image' of .*pad.* with a window of 5"):
        exports.export(data, tmp_path / "none", touch="image")


def test_univtac_has_the_newest_reading_and_says_so(pushes_with_touch, tmp_path):
    pytest.importorskip("PIL.Image", reason="pillow is not installed")
    done = exports.export(pushes_with_touch, tmp_path / "out", "univtac")
    assert done.notes[0].startswith("UniVTAC has one reading a frame: of the windows of pad ")
    assert not any("windows of pad.sum" in note for note in done.notes)
    assert any(note.startswith("left out") and "pad.sum" in note for note in done.notes)
    with h5py.File(tmp_path / "out/hdf5/0.hdf5") as file:
        wanted = Episodes(pushes_with_touch)[0]["pad"][:, -1]
        np.testing.assert_array_equal(file["tactile/pad/force"], wanted)
    said = json.loads((tmp_path / "out/metadata.json").read_text())
    assert said["newest_of_window"] == ["pad"]


def test_windows_of_rows_with_windows_are_joined(generate, tmp_path):
    ball = str(tangere.scenes()["rolling_ball_small"])
    words = ["--episodes", "2", "--steps", "80", "--record"]
    fine = generate(ball, *words, "q,pad,pad.sum", "--every", "1")
    rows = generate(ball, *words, "q,pad/1,pad.sum/1", "--every", "5")
    exports.export(fine, tmp_path / "fine", "zarr", window=20)
    exports.export(rows, tmp_path / "rows", "zarr", window=4)
    for name in ("pad", "pad.sum", "action", "reward"):
        stores = [zarr.open_group(str(tmp_path / out)) for out in ("fine", "rows")]
        one, other = (store[f"data/{name}"] for store in stores)
        np.testing.assert_array_equal(one[:], other[:], err_msg=name)
        if name.startswith("pad"):
            assert one.attrs["window"] == other.attrs["window"]
    assert one.shape[0] == 8
