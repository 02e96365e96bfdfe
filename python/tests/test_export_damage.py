# SPDX-License-Identifier: Apache-2.0
"""Damage: data sets that an export refuses, and exports whose damage `info`, `view` and `validate`
find."""

from __future__ import annotations

import json
import os
import re
import shutil
import signal
import subprocess
import sys

import h5py
import numpy as np
import pytest

import tangere
from tangere import _export_job
from tangere import export as exports
from tangere.data import Episodes

pytest.importorskip("pyarrow", reason="pyarrow is not installed")
pytest.importorskip("zarr", reason="zarr is not installed")
pytest.importorskip("PIL.Image", reason="pillow is not installed")

FORMATS = ["lerobot", "zarr", "ftp1", "univtac", "csv"]
SUMS = r"checksum of its numbers is [0-9a-f]{16}; expected [0-9a-f]{16}"


def flip(path, at):
    with open(path, "r+b") as file:
        file.seek(at)
        (byte,) = file.read(1)
        file.seek(at)
        file.write(bytes([byte ^ 4]))


def shorten(path, by=200):
    os.truncate(path, path.stat().st_size - by)


@pytest.fixture
def damaged(generate, tmp_path):
    """Makes a copy of a data set of four shards whose second one is changed."""
    whole = generate("box_pushing", "--episodes", "50", "--seed", "5", "--shards", "4",
                     "--record", "goal,tactile,q")  # fmt: skip

    def copy(change):
        folder = tmp_path / f"set{len(list(tmp_path.iterdir()))}"
        shutil.copytree(whole, folder)
        change(folder / "shard-00001.h5")
        return folder

    return copy


def flip_number(shard):
    with h5py.File(shard) as file:
        demo = next(iter(file["data"].values()))
        at = demo["obs/tactile"].id.get_offset() + 4000
    flip(shard, at)


def without_actions(shard):
    with h5py.File(shard, "r+") as file:
        del file["data"][next(iter(file["data"]))]["actions"]


def flip_label(shard):
    with h5py.File(shard, "r+") as file:
        demo = next(iter(file["data"].values()))
        demo.attrs["success"] = np.int8(1 - demo.attrs["success"])


LABELS = r"checksum of its episodes' labels \(.*\) is [0-9a-f]{16}; expected [0-9a-f]{16}"
CHANGES = [
    (flip_number, SUMS),
    (flip_label, LABELS),
    (shorten, "truncated"),
    (without_actions, "'actions'"),
]


@pytest.mark.parametrize("to", ["lerobot", "zarr", "csv"])
@pytest.mark.parametrize("change, message", CHANGES, ids=lambda x: getattr(x, "__name__", ""))
def test_a_damaged_data_set_is_refused(damaged, tmp_path, to, change, message):
    data = damaged(change)
    kept = {path.name for path in tmp_path.iterdir()}
    with pytest.raises(tangere.IoError, match=message) as error:
        exports.export(data, tmp_path / "out", to, **({} if to == "csv" else {"workers": 1}))
    text = str(error.value)
    assert str(data / "shard-00001.h5") in text and ("is damaged" in text or to == "csv")
    if change is flip_number and to != "csv":
        assert text.endswith("make it again with the command of the data set and --resume")
    assert {path.name for path in tmp_path.iterdir()} == kept


def test_the_command_refuses_it_with_code_3(damaged, command, tmp_path):
    """Here processes check the shards."""
    for change, message in ((flip_number, SUMS), (shorten, "truncated")):
        data = damaged(change)
        words = [command, "export", data, tmp_path / "out", "--to", "zarr", "--workers", "2"]
        done = subprocess.run(words, capture_output=True, text=True,
                              env=os.environ | {"TANGERE_PYTHON": sys.executable})  # fmt: skip
        assert done.returncode == 3 and done.stderr.count("\n") == 1, done.stderr
        assert re.search(f"shard-00001.h5' is damaged: .*{message}", done.stderr)
        assert not list(tmp_path.glob("out*"))


def from_another_run(shard):
    with h5py.File(shard, "r+") as file:
        file["scene"].attrs["seed"] = type(file["scene"].attrs["seed"])(99)


def copy_of_the_first(shard):
    shutil.copy(shard.with_name("shard-00000.h5"), shard)


def test_shards_that_do_not_belong_together_are_refused(damaged, tmp_path):
    for change, message in (
        (from_another_run, "' does not belong to the same run as '.*: seed: 99 there, 5 here"),
        (copy_of_the_first, "shard-00001.h5' holds episodes 0 to 15; expected 16 to 31"),
    ):
        data = damaged(change)
        for to in FORMATS:
            with pytest.raises(tangere.IoError, match=message):
                exports.export(data, tmp_path / "out", to)


def test_a_damaged_merged_file_is_refused(damaged, tmp_path):
    data = damaged(flip_number) / "robomimic.hdf5"
    with pytest.raises(tangere.IoError, match=f"robomimic.hdf5' is damaged: the {SUMS}"):
        exports.export(data, tmp_path / "out", "zarr", workers=1)


@pytest.fixture(scope="module")
def mixed(generate):
    return generate("box_pushing", "--episodes", "20", "--seed", "5", "--mix", "random=0.3")


@pytest.mark.parametrize("name", ["return", "terminated", "success", "policy", "touching"])
def test_a_changed_label_of_an_episode_is_found(mixed, command, tmp_path, name):
    data = tmp_path / "set"
    shutil.copytree(mixed, data)
    with h5py.File(data / "shard-00000.h5", "r+") as file:
        attributes = file["data/demo_7"].attrs
        old = attributes[name]
        attributes[name] = type(old)(old + 1 if name in ("return", "touching") else 1 - old)
    run = subprocess.run([command, "validate", data], capture_output=True, text=True)
    assert run.returncode == 3 and "shard-00000.h5: " in run.stderr
    assert name == "touching" or re.search(LABELS, run.stderr)


def test_masks_and_merged_files_are_validated(generate, command, tmp_path):
    data = tmp_path / "set"
    whole = generate("box_pushing", "--episodes", "20", "--seed", "5")
    shutil.copytree(whole, data)
    merged = data / "robomimic.hdf5"

    def validate(where=data):
        run = subprocess.run([command, "validate", where], capture_output=True, text=True)
        assert run.returncode in (0, 3), run.stderr
        return run.stderr

    assert validate() == ""
    with h5py.File(merged, "r+") as file:  # a mask of the user's is none of ours
        file["mask/mine"] = np.asarray([b"demo_3"])
        del file["mask/valid"]
        file["mask/valid"] = np.asarray([b"demo_1"])
    assert validate() == "" and len(Episodes(data).mask("mine")) == 1
    with h5py.File(merged, "r+") as file:
        names = file["mask/train"][()]
        names[0] = b"demo_1"
        file["mask/train"][()] = names
    assert "the checksum of the names in mask/train is" in validate()
    assert "the checksum of the names in mask/train is" in validate(merged)
    with pytest.raises(tangere.IoError, match="the checksum of the names in mask/train is"):
        Episodes(data).mask("train")
    shutil.copy(whole / "robomimic.hdf5", merged)
    shorten(merged)
    assert "robomimic.hdf5: " in validate() and "truncated" in validate()
    shutil.copy(whole / "robomimic.hdf5", merged)
    (view,) = data.rglob("main_data.hdf5")
    shorten(view)
    assert "main_data.hdf5: " in validate() and "truncated" in validate()


def test_one_episode_of_a_table_needs_its_own_shard_alone(damaged, command, tmp_path):
    data = damaged(flip_number)
    ours, theirs = (Episodes(path).names[0].removeprefix("demo_")
                    for path in (data / "shard-00000.h5", data / "shard-00001.h5"))  # fmt: skip

    def code(episode):
        words = [command, "export", data, "--csv", tmp_path / "out.csv", "--episode", episode]
        return subprocess.run(words, capture_output=True).returncode

    assert (code(theirs), code(ours)) == (3, 0)


def test_reading_a_damaged_shard_names_it(damaged):
    data = damaged(without_actions)
    episodes = Episodes(data)
    for k, name in enumerate(episodes.names):
        if name == Episodes(data / "shard-00001.h5").names[0]:
            with pytest.raises(tangere.IoError, match="shard-00001.h5' is damaged: .*'actions'"):
                episodes.arrays(k, ["actions"])
    with pytest.raises(tangere.IoError, match="shard-00001.h5' is damaged: .*truncated"):
        Episodes(damaged(shorten))


PARQUET, EPISODES = "data/chunk-000/file-000.parquet", "meta/episodes/chunk-000/file-000.parquet"
CHUNK = "data/tactile/0.0.0.0"
GROUP = "data/right_tactile_data_tactile/0.0.0.0.0"


def edit(old, new):
    def change(path):
        text = path.read_text()
        assert old in text
        path.write_text(text.replace(old, new, 1))

    return change


def remove(path):
    path.unlink()


def drop_last_row(path):
    lines = path.read_text().splitlines(keepends=True)
    path.write_text("".join(lines[:-1]))


def end_in_a_number(path):
    shorten(path, 2)


DAMAGE = [
    ("lerobot", PARQUET, shorten, f"{PARQUET}' is damaged: it has "),
    ("lerobot", EPISODES, shorten, f"{EPISODES}' is damaged: it has "),
    ("lerobot", "meta/stats.json", shorten, "stats.json' is damaged: it has "),
    ("lerobot", EPISODES, remove, f"has no {EPISODES}"),
    ("lerobot", "meta/info.json", edit('"total_frames": 2000', '"total_frames": 2001'),
     "info.json' is damaged: it counts 2001 frames; expected 2000, as "),
    ("zarr", CHUNK, shorten, f"{CHUNK}' is damaged: it has "),
    ("zarr", CHUNK, remove, "data/tactile' is damaged: it has "),
    ("zarr", "meta/episode_ends/0", remove, "episode_ends/0: cannot be opened"),
    ("zarr", ".zattrs", edit('"frames": 2000', '"frames": 1999'), "it counts 2000 frames; expect"),
    ("ftp1", GROUP, shorten, f"{GROUP}' is damaged: it has "),
    ("ftp1", GROUP, remove, "data/right_tactile_data_tactile' is damaged: it has "),
    ("univtac", "hdf5/13.hdf5", shorten, "hdf5/13.hdf5' is damaged: it has "),
    ("univtac", "hdf5/13.hdf5", remove, "has no hdf5/13.hdf5"),
    ("univtac", "metadata.json", edit('"frames": 2000', '"frames": 1990'),
     "its episodes have 2000 steps; expected 1990"),
    ("univtac", "metadata.json", edit('"bytes": [', '"bytes": [7,'), "lists of 'stored' differ"),
    ("csv", "", drop_last_row, "it has 1999 rows of 20 episodes; expected 2000 of 20, as '"),
    ("csv", "", end_in_a_number, "line 2001 does not end"),
]  # fmt: skip


@pytest.mark.parametrize("to, name, change, message", DAMAGE)
def test_damage_of_an_export_is_found(sets, command, tmp_path, to, name, change, message):
    copy = tmp_path / f"out.{to}"
    (shutil.copytree if sets[to].is_dir() else shutil.copyfile)(sets[to], copy)
    if to == "csv":
        shutil.copyfile(f"{sets[to]}.json", f"{copy}.json")
    change(copy / name if name else copy)
    environment = os.environ | {"TANGERE_PYTHON": sys.executable}
    for words in (["info", copy], ["view", copy, "-o", tmp_path / "page.html"], ["validate", copy]):
        done = subprocess.run([command, *words], capture_output=True, text=True, env=environment)
        assert done.returncode == 3, words
        assert message in done.stderr, words
    if to != "csv":
        with pytest.raises(tangere.IoError, match="damaged|has no|cannot be opened"):
            tangere.view(copy)
    assert not (tmp_path / "page.html").exists()


@pytest.mark.parametrize("to, name", [
    ("lerobot", PARQUET), ("lerobot", EPISODES), ("zarr", CHUNK), ("ftp1", GROUP),
    ("univtac", "hdf5/13.hdf5"),
])  # fmt: skip
def test_flipped_bytes_are_found_by_reading_all(sets, command, tmp_path, to, name):
    copy = tmp_path / "out"
    shutil.copytree(sets[to], copy)

    def run(*words):
        done = subprocess.run([command, *words, "--json"], capture_output=True, text=True)
        return done.returncode, json.loads(done.stdout)

    code, said = run("validate", copy)
    assert code == 0 and said["problems"] == [] and said["frames"] == 2000
    flip(copy / name, (copy / name).stat().st_size // 2)
    assert run("info", copy)[0] == 0  # it reads no numbers
    code, said = run("validate", copy)
    path = copy / (name.rpartition("/")[0] if to in ("zarr", "ftp1") else name)
    assert code == 3 and len(said["problems"]) == 1
    assert said["error"].startswith(f"'{path}' is damaged: the checksum of its bytes is ")


@pytest.mark.parametrize("to, name", [
    ("lerobot", "data/chunk-000/file-001.parquet"), ("lerobot", "meta/episodes/more.parquet"),
    ("zarr", "meta/mine/0"), ("univtac", "hdf5/20.hdf5"),
])  # fmt: skip
def test_a_file_that_is_not_of_the_export_is_found(sets, command, tmp_path, to, name):
    copy = tmp_path / "out"
    shutil.copytree(sets[to], copy)
    (copy / "notes.txt").write_text("mine")
    words = [command, "validate", copy]
    assert subprocess.run(words, capture_output=True).returncode == 0
    (copy / name).parent.mkdir(exist_ok=True)
    (copy / name).write_bytes(b"more")
    (copy / "data").mkdir(exist_ok=True)
    (copy / "data/.cache").write_bytes(b"a tool's")
    run = subprocess.run(words, capture_output=True, text=True)
    assert run.returncode == 3 and f"'{copy / name}' is not a file of this export" in run.stderr


@pytest.mark.parametrize("to, name", [
    ("zarr", "data/tactile"), ("zarr", "meta/episode_ends"), ("ftp1", "data/action"),
])  # fmt: skip
def test_a_changed_description_of_an_array_is_found(sets, command, tmp_path, to, name):
    copy = tmp_path / "out"
    shutil.copytree(sets[to], copy)
    about = copy / name / ".zarray"
    edit('"order": "C"', '"order": "F"')(about)
    run = subprocess.run([command, "validate", copy], capture_output=True, text=True)
    assert run.returncode == 3 and f"'{about}' is damaged: the checksum of its" in run.stderr


@pytest.mark.parametrize("to, name", [
    ("zarr", "data/tactile/7.0.0.0"), ("ftp1", "data/other/0"), ("univtac", "hdf5/7.h5"),
])  # fmt: skip
def test_a_foreign_file_is_not_taken_by_a_resumed_run(pushes, tmp_path, monkeypatch, to, name):
    out, part = tmp_path / "out", tmp_path / "out.part"

    def stop(folder):
        raise KeyboardInterrupt

    with monkeypatch.context() as patch:
        patch.setattr(_export_job.Folder, "finish", stop)
        with pytest.raises(KeyboardInterrupt):
            exports.export(pushes, out, to, workers=1)
    (part / name).parent.mkdir(exist_ok=True)
    (part / name).write_bytes(b"mine")
    (part / name).with_suffix(".partial").write_bytes(b"a killed run's")
    with pytest.raises(tangere.InputError, match="is not a file of this export; remove it"):
        exports.export(pushes, out, to, workers=1, resume=True)
    assert (part / name).read_bytes() == b"mine"
    (part / name).unlink()
    assert exports.export(pushes, out, to, workers=1, resume=True).complete
    assert not list(out.rglob("*.partial")) and not part.exists()


def test_damaged_sums_of_a_stopped_run_are_named(pushes, tmp_path, monkeypatch):
    with monkeypatch.context() as patch:
        patch.setattr(_export_job.Folder, "finish", lambda folder: sys.exit(75))
        with pytest.raises(SystemExit):
            exports.export(pushes, tmp_path / "out", "zarr", workers=1)
    job = tmp_path / "out.part/.parts/job.json"
    job.write_text(json.dumps(json.loads(job.read_text()) | {"begun": [1]}))
    with pytest.raises(tangere.IoError, match="job.json' is damaged: its 'begun' is no list"):
        exports.export(pushes, tmp_path / "out", "zarr", workers=1, resume=True)


def test_a_mask_of_numbers_and_a_task_that_is_no_text_are_refused(pushes, tmp_path):
    data = tmp_path / "set"
    shutil.copytree(pushes, data)
    with h5py.File(data / "robomimic.hdf5", "r+") as file:
        file["mask/mine"] = np.arange(3)
    with pytest.raises(tangere.InputError, match="mask 'mine' is no list of texts; expected names"):
        exports.export(data, tmp_path / "out", "zarr", mask="mine")
    with pytest.raises(tangere.InputError, match="task 5; expected a text"):
        exports.export(data, tmp_path / "out", "lerobot", task=5)


def test_a_stop_during_imports_is_no_traceback(pushes, command, tmp_path):
    (tmp_path / "numpy.py").write_text("import time\nprint(1, flush=True)\ntime.sleep(60)\n")
    path = os.pathsep.join([str(tmp_path), os.environ.get("PYTHONPATH", "")])
    process = subprocess.Popen(
        [command, "export", pushes, tmp_path / "out", "--to", "zarr"], text=True,
        env=os.environ | {"PYTHONPATH": path, "TANGERE_PYTHON": sys.executable},
        stdout=subprocess.PIPE, stderr=subprocess.PIPE,
    )  # fmt: skip
    assert process.stdout.readline() == "1\n"
    process.send_signal(signal.SIGINT)
    assert process.communicate(timeout=30)[1] == "tangere export: stopped\n"
    assert process.returncode == 130


def test_an_export_of_an_older_version_has_no_sums(sets, command, tmp_path):
    shutil.copytree(sets["zarr"], tmp_path / "out")
    notes = tmp_path / "out/.zattrs"
    said = json.loads(notes.read_text())
    del said["stored"]
    notes.write_text(json.dumps(said))
    words = [command, "validate", tmp_path / "out"]
    done = subprocess.run(words, capture_output=True, text=True)
    assert done.returncode == 3 and "has no checksums of its files" in done.stderr
    assert subprocess.run([command, "info", tmp_path / "out"], capture_output=True).returncode == 0


def test_a_page_of_flipped_bytes_names_the_export(sets, tmp_path):
    shutil.copytree(sets["lerobot"], tmp_path / "out")
    path = tmp_path / "out" / PARQUET
    end = path.stat().st_size
    for at in range(end - 400, end - 10, 40):  # the footer, without which nothing can be read
        flip(path, at)
    with pytest.raises(tangere.IoError, match="out' is damaged"):
        tangere.view(tmp_path / "out")
