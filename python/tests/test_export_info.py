# SPDX-License-Identifier: Apache-2.0
"""`tangere info` of exports: what each format holds, and what of it is damaged or foreign."""

from __future__ import annotations

import json
import shutil
import subprocess

import h5py
import pytest

import tangere
from tangere import export as exports
from tangere._export_frames import action_unit, action_units
from tangere.data import Episodes

pytest.importorskip("pyarrow", reason="pyarrow is not installed")
pytest.importorskip("zarr", reason="zarr is not installed")
pytest.importorskip("PIL.Image", reason="pillow is not installed")

FORMATS = ["lerobot", "zarr", "ftp1", "univtac", "csv"]


@pytest.fixture
def info(command):
    def run(path):
        done = subprocess.run([command, "info", path, "--json"], capture_output=True, text=True)
        return done.returncode, json.loads(done.stdout)

    return run


@pytest.mark.parametrize("to", FORMATS)
def test_every_format_is_described(sets, info, command, to):
    code, said = info(sets[to])
    assert code == 0 and (said["format"], said["episodes"], said["frames"]) == (to, 20, 2000)
    files = [p for p in (sets[to].rglob("*") if sets[to].is_dir() else [sets[to]]) if p.is_file()]
    assert said["files"] == len(files) and said["bytes"] == sum(p.stat().st_size for p in files)
    arrays = {a["name"]: (a["shape"], a["type"], a["unit"]) for a in said["arrays"]}
    touch = {
        "lerobot": ("observation.tactile", [13, 10, 3]),
        "zarr": ("data/tactile", [13, 10, 3]),
        "ftp1": ("data/right_tactile_data_tactile", [1, 13, 10, 3]),
        "univtac": ("tactile/tactile/force", [13, 10, 3]),
    }
    if to == "csv":
        assert arrays["goal/2"] == ([], "number", "rad")
    else:
        name, shape = touch[to]
        assert arrays[name] == (shape, "float32", "N")
    assert said["seconds_per_frame"] == 0.025 and "generate box_pushing" in said["made_of"]
    if to == "ftp1":
        assert arrays["data/sub_task_instruction"][1] == "text"
    text = subprocess.run([command, "info", sets[to]], capture_output=True, text=True).stdout
    assert f"{to}: " in text and "episodes: 20, frames: 2000" in text


def test_damage_is_named(sets, info, tmp_path):
    def damaged(to, change):
        copy = tmp_path / f"{to}.{len(list(tmp_path.iterdir()))}"
        (shutil.copytree if sets[to].is_dir() else shutil.copyfile)(sets[to], copy)
        if to == "csv":
            copy = copy.rename(copy.with_suffix(".csv"))
        change(copy)
        code, said = info(copy)
        assert code == 3
        return said["error"]

    def edit(name, old, new):
        def change(folder):
            text = (folder / name).read_text()
            assert old in text
            (folder / name).write_text(text.replace(old, new, 1))

        return change

    def remove(name):
        return lambda folder: (folder / name).unlink()

    def shorten(name):
        return lambda path: (path / name).write_bytes((path / name).read_bytes()[:-8])

    for to, change, message in (
        ("lerobot", edit("meta/info.json", "{", ""), "info.json' is damaged: expected an object"),
        ("lerobot", edit("meta/info.json", '"total_frames": ', '"total_frames": -'),
         "'total_frames' is missing or is no whole number"),
        ("lerobot", edit("meta/info.json", '"total_episodes": 20', '"total_episodes": 21'),
         "names 20 demos; expected 21"),
        ("lerobot", remove("data/chunk-000/file-000.parquet"), "has no data/chunk-000/file-000."),
        ("zarr", edit("data/tactile/.zarray", "2000", "1999"), "has 1999 rows; expected 2000"),
        ("zarr", shorten("meta/episode_ends/0"), "has 152 bytes; expected 20 numbers"),
        ("zarr", edit("data/action/.zarray", "<f4", "<z4"), "its dtype is '<z4'"),
        ("univtac", remove("hdf5/7.hdf5"), "has no hdf5/7.hdf5; expected 20 files"),
        ("univtac", edit("metadata.json", '"steps": 100', '"steps": 99'),
         "its episodes have 1999 steps; expected 2000, its 'frames'"),
        ("csv", lambda path: path.write_text(path.read_text() + "1,2\n"), "line 2002 has 2 col"),
    ):  # fmt: skip
        assert message in damaged(to, change), (to, message)


def test_a_data_set_is_one_whatever_lies_beside_it(pushes, info, tmp_path):
    shutil.copytree(pushes, tmp_path / "set")
    (tmp_path / "set/hdf5").mkdir()
    (tmp_path / "set/.zgroup").write_text("{}")
    code, said = info(tmp_path / "set")
    assert code == 0 and said["demos"] == 20


def test_what_is_no_export_of_tangere_is_told(sets, info, tmp_path):
    for to, name, message in (
        ("lerobot", "meta/tangere.json", "LeRobot data set that 'tangere export' did not write"),
        ("zarr", ".zattrs", "Zarr store that 'tangere export' did not write"),
        ("univtac", "metadata.json", "UniVTAC data set that 'tangere export' did not write"),
    ):
        shutil.copytree(sets[to], tmp_path / to)
        (tmp_path / to / name).unlink()
        code, said = info(tmp_path / to)
        assert code == 3 and message in said["error"]
    (tmp_path / "zarr" / ".zattrs").write_text("{}")
    assert "Zarr store that 'tangere export' did not" in info(tmp_path / "zarr")[1]["error"]
    (tmp_path / "out.part/.parts").mkdir(parents=True)
    code, said = info(tmp_path / "out.part")
    assert code == 3 and "is an export that is not complete" in said["error"]
    (tmp_path / "empty").mkdir()
    assert "has no shards" in info(tmp_path / "empty")[1]["error"]
    (tmp_path / "other.csv").write_text("a,b\n1,2\n")
    assert info(tmp_path / "other.csv")[0] == 3


def test_a_table_has_the_unit_of_every_number_of_a_body(generate, command, info, tmp_path):
    data = generate(str(tangere.scenes()["mug"]), "--episodes", "1", "--steps", "10", "--every",
                    "5", "--record", "bodies")  # fmt: skip
    table = tmp_path / "out.csv"
    subprocess.run([command, "export", data, table, "--to", "csv", "--quiet"], check=True)
    arrays = {array["name"]: array["unit"] for array in info(table)[1]["arrays"]}
    units = [unit for name, unit in arrays.items() if name.startswith("bodies/")]
    assert len(units) > 13 and len(set(units[:13])) > 2
    assert units == units[:13] * (len(units) // 13)


def test_units_that_a_data_set_does_not_state_are_not_invented(generate, info, tmp_path):
    data = generate(str(tangere.scenes()["mug"]), "--episodes", "1", "--steps", "10", "--every",
                    "5", "--record", "left_finger")  # fmt: skip
    with h5py.File(data / "shard-00000.h5", "r+") as file:  # as older versions have it
        del file["scene"].attrs["action_units"]
    episodes = Episodes(data)
    assert set(action_units(episodes)) == {""} and action_unit(episodes) == ""


MUG = "m/s, m/s, m/s, rad/s, rad/s, rad/s"


@pytest.mark.parametrize("to, options, wanted", [
    ("lerobot", {}, {"observation.state": "m, m, m, m/s, m/s, m/s"}),
    ("zarr", {"privileged": True}, {"data/q": "m", "data/v": "m/s", "data/v_privileged": MUG}),
    ("ftp1", {"joints": "hand.position"}, {"data/right_arm_joints": "m"}),
    ("univtac", {}, {"embodiment/joint": "m"}),
])  # fmt: skip
def test_coordinates_have_their_units(mugs, info, tmp_path, to, options, wanted):
    exports.export(mugs, tmp_path / "out", to, workers=1, **options)
    units = {array["name"]: array["unit"] for array in info(tmp_path / "out")[1]["arrays"]}
    assert {name: units[name] for name in wanted} == wanted


@pytest.fixture(scope="module")
def mugs(generate):
    return generate(str(tangere.scenes()["mug"]), "--episodes", "1", "--steps", "10", "--every",
                    "5", "--record", "q,v,left_finger")  # fmt: skip
