# SPDX-License-Identifier: Apache-2.0
"""Exports of all formats against the shards, by one process and by many, stopped and resumed."""

from __future__ import annotations

import filecmp
import io
import json
import os
import re
import resource
import signal
import subprocess
import sys
import time

import h5py
import numpy as np
import pytest

import tangere
from tangere import _export_job, export as exports

pytest.importorskip("pyarrow", reason="pyarrow is not installed")
zarr = pytest.importorskip("zarr", reason="zarr is not installed")
Image = pytest.importorskip("PIL.Image", reason="pillow is not installed")


def same_files(a, b):
    names = sorted(path.relative_to(a) for path in a.rglob("*") if path.is_file())
    assert names == sorted(path.relative_to(b) for path in b.rglob("*") if path.is_file())
    return filecmp.cmpfiles(a, b, names, shallow=False)[0] == names


def stored(data, key):
    with h5py.File(data / "robomimic.hdf5") as file:
        demos = file["data"]
        return np.concatenate([demos[f"demo_{i}"][key][()] for i in range(len(demos))])


@pytest.fixture(scope="module")
def presses(generate, tmp_path_factory):
    """Presses of a gel with pictures of 48 × 64 pixels and printed markers."""
    text = tangere.scenes()["gel_press"].read_text()
    layer = '<layer cell="0.75e-3" margin="1e-3"/>'
    varies = '<tactile name="gel" field="kn" uniform="2e8 3e8"/>'
    assert layer in text and varies in text
    more = '<markers/><picture rows="48" cols="64" markers="9 7"/>'
    press = tmp_path_factory.mktemp("scene") / "press.xml"
    press.write_text(text.replace(varies, "").replace(layer, layer + more))
    return generate(str(press), "--episodes", "3", "--seed", "4", "--every", "25", "--record",
                    "q,v,gel,gel.markers,gel.height,gel.rgb,gel.rgb_marker")  # fmt: skip


@pytest.fixture(scope="module")
def balls(generate):
    """Every step of a ball that is rolled, with controls that are held."""
    return generate(str(tangere.scenes()["rolling_ball_small"]), "--episodes", "2", "--steps",
                    "146", "--every", "1", "--record", "q,pad,pad.sum")  # fmt: skip


def test_zarr_has_every_number(pushes, tmp_path):
    done = exports.export(pushes, tmp_path / "out", "zarr", privileged=True)
    assert done.complete and (done.episodes, done.frames, done.fps) == (20, 2000, 40)
    root = zarr.open_group(str(tmp_path / "out"), mode="r")
    lengths = [100] * 20
    np.testing.assert_array_equal(root["meta/episode_ends"][:], np.cumsum(lengths))
    keys = {"action": "actions", "reward": "rewards", "done": "dones"}
    for name, key in ({k: f"obs/{k}" for k in ("q", "v", "goal", "tactile")} | keys).items():
        wanted, array = stored(pushes, key), root[f"data/{name}"]
        assert array.dtype == wanted.dtype, name
        np.testing.assert_array_equal(array[:], wanted, err_msg=name)
    assert set(done.features) == {*dict(root["data"].arrays())}
    assert root["data/success"][:].sum() == stored(pushes, "dones")[root["data/success"][:]].sum()
    assert root["data/tactile"].attrs["unit"] == "N" and root["data/q"].attrs["names"]
    assert "generate box_pushing" in root.attrs["command"]


def test_ftp1_has_its_tactile_keys(presses, tmp_path):
    options = {"joints": "hand.x,hand.z", "task": "press the gel", "sensor": "GelSightMini",
               "hand": "hand.y=6,hand.x=1"}  # fmt: skip
    done = exports.export(presses, tmp_path / "out", "ftp1", **options)
    assert done.notes == ["left out, because FTP-1 has no place for it: v"]
    data = zarr.open_group(str(tmp_path / "out/data"), mode="r")
    count = len(stored(presses, "actions"))
    field = data["right_tactile_data_gel"]
    np.testing.assert_array_equal(field[:, 0], stored(presses, "obs/gel"))
    assert field.shape[:2] == (count, 1) and field.attrs["unit"] == "N"
    picture = data["right_tactile_data_gel_rgb"]
    np.testing.assert_array_equal(picture[:, 0], stored(presses, "obs/gel.rgb"))
    for group, kind in (("gel", "matrix"), ("gel_rgb", "image"), ("gel_markers", "matrix")):
        assert (data[f"right_tactile_area_{group}"][:] == [[0]]).all()
        assert set(data[f"right_tactile_sensor_{group}"][:]) == {"GelSightMini"}
        assert set(data[f"right_tactile_type_{group}"][:]) == {kind}
    q = stored(presses, "obs/q")
    np.testing.assert_array_equal(data["right_arm_joints"][:], q[:, [0, 2]])
    np.testing.assert_array_equal(data["right_hand_joints"][:], q[:, [1, 0]])
    index = data["right_hand_joints_idx"]
    assert index.dtype == np.int32 and (index[:] == [6, 1]).all() and index.shape == (count, 2)
    assert set(data["sub_task_instruction"][:]) == {"press the gel"}
    stamps = data["timestamps"][:]
    assert (stamps[:: count // 3] == 0).all() and stamps.max() == count // 3 - 1


def test_ftp1_tells_pads_apart(generate, tmp_path):
    grasps = generate("stable_grasp", "--episodes", "2", "--seed", "3")
    done = exports.export(grasps, tmp_path / "out", "ftp1", side="left")
    assert done.notes == [
        "FTP-1's loader reads the touch of a hand with joints alone; see --hand",
        "left out, because FTP-1 has no place for it: q, v",
    ]
    data = zarr.open_group(str(tmp_path / "out/data"), mode="r")
    flow = stored(grasps, "obs/flow")  # (n, 4, 13, 10): pad, component
    pads = data["left_tactile_data_flow"][:]
    assert pads.shape == (len(flow), 2, 13, 10, 2)
    for pad in (0, 1):
        np.testing.assert_array_equal(pads[:, pad, ..., 1], flow[:, 2 * pad + 1])
    assert (data["left_tactile_area_flow"][:] == [0, 1]).all()


def test_univtac_has_its_groups(presses, tmp_path):
    done = exports.export(presses, tmp_path / "out", "univtac", joints="hand.x,hand.y,hand.z")
    files = sorted(tmp_path.glob("out/hdf5/*.hdf5"))
    assert [path.name for path in files] == ["0.hdf5", "1.hdf5", "2.hdf5"]
    said = json.loads((tmp_path / "out/metadata.json").read_text())
    assert said["datasets"] == done.features and said["joint_units"] == ["m"] * 3
    with h5py.File(presses / "robomimic.hdf5") as wanted, h5py.File(files[1]) as file:
        demo, gel = wanted["data/demo_1"], file["tactile/gel"]
        count = len(demo["actions"])
        np.testing.assert_array_equal(file["step"], np.arange(count))
        np.testing.assert_array_equal(file["embodiment/joint"], demo["obs/q"][:, :3])
        np.testing.assert_array_equal(file["action"], demo["actions"])
        np.testing.assert_array_equal(gel["force"], demo["obs/gel"])
        height = demo["obs/gel.height"][..., 0]
        np.testing.assert_array_equal(gel["press_depth"], np.float32(1000 * height))
        assert gel["press_depth"][:].max() > 0.1  # [mm]
        for name in ("rgb", "rgb_marker"):
            assert gel[name].dtype.kind == "S"
            blue_first = np.asarray(Image.open(io.BytesIO(gel[name][-1])))  # as its writer has it
            picture = demo[f"obs/gel.{name}"][-1].astype(int)
            assert np.abs(blue_first[..., ::-1] - picture).mean() < 3
        rest, now = np.moveaxis(gel["marker"][:], 1, 0)  # (T, n, 2) [pixels]
        assert (rest == rest[0]).all() and rest.shape[1:] == (48 * 64, 2)
        np.testing.assert_allclose(rest[0][[0, -1]], [[0.5, 0.5], [63.5, 47.5]], atol=1e-4)
        moved = demo["obs/gel.markers"][:].reshape(count, -1, 2)[..., ::-1]
        size = wanted["scene/sensors/gel"].attrs["picture_pixel_size"][::-1]
        np.testing.assert_allclose(now - rest, moved / size, atol=1e-4)
        assert np.abs(now - rest).max() > 0.1


def test_videos_follow_one_another(generate, tmp_path):
    av = pytest.importorskip("av", reason="av is not installed")
    import pyarrow.parquet as pq

    text = tangere.scenes()["rolling_ball_small"].read_text()
    eye = '<camera name="eye" pos="0 -0.2 0.1" look="0 0 0" rows="64" cols="80"/></sensor>'
    (tmp_path / "seen.xml").write_text(text.replace("</sensor>", eye))
    data = generate(str(tmp_path / "seen.xml"), "--episodes", "3", "--steps", "60", "--every", "10",
                    "--record", "pad,eye.rgb")  # fmt: skip
    exports.export(data, tmp_path / "out", pictures="video", file_megabytes=0.2)
    rows = pq.read_table(tmp_path / "out/meta/episodes/chunk-000/file-000.parquet").to_pylist()
    name, rgb = "observation.images.eye.rgb", stored(data, "obs/eye.rgb")
    info = json.loads((tmp_path / "out/meta/info.json").read_text())
    assert (
        info["features"][name]["dtype"] == "video"
        and name not in pq.read_schema(tmp_path / "out/data/chunk-000/file-000.parquet").names
    )
    shown = 0
    for row in rows:
        place = {k: row[f"videos/{name}/{k}"] for k in ("chunk_index", "file_index")}
        path = tmp_path / "out" / info["video_path"].format(video_key=name, **place)
        with av.open(str(path)) as video:
            frames = [frame.to_ndarray(format="rgb24") for frame in video.decode(video=0)]
        start = round(row[f"videos/{name}/from_timestamp"] * info["fps"])
        end = round(row[f"videos/{name}/to_timestamp"] * info["fps"])
        part = rgb[row["dataset_from_index"] : row["dataset_to_index"]]
        assert end - start == len(part)
        for frame, wanted in zip(frames[start:end], part, strict=True):
            assert np.abs(frame.astype(int) - wanted).mean() < 6
            shown += 1
    assert shown == len(rgb) and len(list(tmp_path.glob("out/videos/*/*/*.mp4"))) == 2
    (tmp_path / "small.xml").write_text(
        text.replace("</sensor>", eye.replace('rows="64"', 'rows="63"'))
    )
    small = generate(str(tmp_path / "small.xml"), "--episodes", "1", "--steps", "20", "--every",
                     "10", "--record", "eye.rgb")  # fmt: skip
    with pytest.raises(tangere.InputError, match="63 × 80 as video; expected even sizes of 64"):
        exports.export(small, tmp_path / "none", pictures="video")


def test_a_window_has_the_touch_between_frames(balls, tmp_path):
    exports.export(balls, tmp_path / "zarr", "zarr", window=20, privileged=True)
    root = zarr.open_group(str(tmp_path / "zarr"), mode="r")
    window = root["data/pad"][:]
    q = np.hstack([root["data/q"][:], root["data/q_privileged"][:]])  # of the pad, of the ball
    np.testing.assert_array_equal(root["meta/episode_ends"][:], [8, 16])  # of 146 rows each
    with h5py.File(balls / "shard-00000.h5") as file:
        for episode in (0, 1):
            demo = file[f"data/demo_{episode}"]
            pad = demo["obs/pad"][:]
            part = window[8 * episode : 8 * episode + 8]
            assert part.shape == (8, 20, *pad.shape[1:])
            np.testing.assert_array_equal(part[0], np.broadcast_to(pad[0], part[0].shape))
            # The windows one after the other are the rows again.
            np.testing.assert_array_equal(part[1:].reshape(140, *pad.shape[1:]), pad[1:141])
            np.testing.assert_array_equal(q[8 * episode : 8 * episode + 8], demo["obs/q"][::20])
    assert np.abs(window).max() > 0
    done = exports.export(balls, tmp_path / "lerobot", window=20)
    info = json.loads((tmp_path / "lerobot/meta/info.json").read_text())
    assert info["features"]["observation.pad"]["shape"] == list(window.shape[1:])
    assert info["features"]["observation.pad.sum"]["shape"] == [20, 6]
    assert done.frames == 16 and done.fps == round(1 / (20 * done.seconds_per_action / 20))
    with pytest.raises(tangere.InputError, match="touch 'image' of 'pad', .* with a window of 20"):
        exports.export(balls, tmp_path / "none", window=20, touch="image")
    assert "20 samples a frame" in (tmp_path / "lerobot/README.md").read_text()


def test_windows_that_make_no_sense_are_refused(pushes, generate, tmp_path):
    bare = generate("dummy", "--episodes", "1")
    for data, options, message in (
        (pushes, {"window": 0}, "window 0; expected a whole number"),
        (pushes, {"window": 4}, "the action changes in row 1, within the 4 rows of a frame"),
        (bare, {"window": 4}, "without a reading of a sensor"),
    ):
        with pytest.raises(tangere.InputError, match=message):
            exports.export(data, tmp_path / "out", "zarr", **options)
    assert not list(tmp_path.iterdir())


@pytest.mark.parametrize("to", ["lerobot", "zarr", "ftp1", "univtac"])
def test_the_bytes_do_not_depend_on_the_processes(presses, tmp_path, monkeypatch, to):
    many_parts(monkeypatch)
    options = {"file_megabytes": 0.01} if to == "lerobot" else {}
    seen = []
    done = exports.export(presses, tmp_path / "one", to, workers=1, **options)
    exports.export(presses, tmp_path / "two", to, workers=2, **options,
                   progress=lambda *at: seen.append(at))  # fmt: skip
    assert done.files >= 3 and same_files(tmp_path / "one", tmp_path / "two")
    assert seen[0][0] == 0 and seen[-1] == (done.frames, done.frames)
    assert [at for at, _ in seen] == sorted(at for at, _ in seen)


def many_parts(monkeypatch):
    monkeypatch.setattr("tangere._export_zarr._PART_BYTES", 1 << 18)
    monkeypatch.setattr("tangere._export_univtac._EPISODES", 1)


RUN = """
import sys, time, tangere._export_zarr as z, tangere.export as e
z._PART_BYTES = 1 << 18
write = z.ZarrStore.write
def slow(self, folder, part):
    time.sleep(float(sys.argv[4]))
    write(self, folder, part)
z.ZarrStore.write = slow
sys.exit(e.main([*sys.argv[1:3], "--to", "zarr", "--workers", "1", *sys.argv[5:]]))
"""


def start(data, out, marker, seconds, *words, **variables):
    return subprocess.Popen(
        [sys.executable, "-c", RUN, str(data), str(out), marker, str(seconds), *words],
        env=os.environ | {"PYTHONPATH": os.pathsep.join(p for p in sys.path if p)} | variables,
        stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True,
    )  # fmt: skip


def test_a_run_that_was_stopped_or_killed_is_resumed(pushes, tmp_path, monkeypatch):
    many_parts(monkeypatch)
    exports.export(pushes, tmp_path / "whole", "zarr")
    out, parts = tmp_path / "out", tmp_path / "out.part/.parts"
    for number, code in ((signal.SIGTERM, 75), (signal.SIGKILL, -9)):
        known = len(list(parts.glob("0*"))) if parts.is_dir() else 0
        with start(pushes, out, "", 0.05, "--resume") as process:
            until = time.monotonic() + 20
            while time.monotonic() < until and len(list(parts.glob("0*"))) < known + 2:
                time.sleep(0.01)
            process.send_signal(number)
            _, err = process.communicate()
        assert process.returncode == code, err
        assert not out.exists() and len(list(parts.glob("0*"))) >= known + 2
    seen = []
    exports.export(pushes, out, "zarr", resume=True, progress=lambda *at: seen.append(at))
    assert seen[0][0] > 0 and same_files(out, tmp_path / "whole")
    before = (out / ".zattrs").stat().st_mtime_ns
    assert exports.export(pushes, out, "zarr", resume=True).complete  # nothing is left to do
    assert (out / ".zattrs").stat().st_mtime_ns == before
    with pytest.raises(tangere.IoError, match="exists already"):
        exports.export(pushes, out, "zarr", resume=True, privileged=True)


@pytest.fixture
def unfinished(pushes, tmp_path, monkeypatch):
    """A run whose parts are all there, and that was stopped before it joined them: its folder."""
    many_parts(monkeypatch)

    def stopped(to, options):
        folder = tmp_path / "out.part"
        with monkeypatch.context() as patch:
            patch.setattr(_export_job.Folder, "finish", stop)
            with pytest.raises(KeyboardInterrupt):
                exports.export(pushes, tmp_path / "out", to, workers=1, **options)
        assert len(list((folder / ".parts").glob("*.sums"))) > 1
        return folder

    return stopped


def stop(folder):
    raise KeyboardInterrupt


def flip_middle(path):
    data = bytearray(path.read_bytes())
    data[len(data) // 2] ^= 4
    path.write_bytes(data)


@pytest.mark.parametrize(
    "to, name, change",
    [
        ("zarr", "data/tactile/1.0.0.0", flip_middle),
        ("zarr", "data/tactile/1.0.0.0", lambda path: path.unlink()),
        ("zarr", ".parts/00001.sums", lambda path: path.write_text("{")),
        ("lerobot", "data/chunk-000/file-001.parquet", flip_middle),
        ("lerobot", ".parts/00001.npz", lambda path: os.truncate(path, 100)),
        ("univtac", "hdf5/1.hdf5", lambda path: os.truncate(path, 100)),
    ],
)
def test_a_part_that_has_changed_is_written_again(unfinished, pushes, tmp_path, to, name, change):
    given = {"lerobot": {"file_megabytes": 1}, "univtac": {"joints": "hand_slide.axis0"}}
    options = given.get(to, {})
    exports.export(pushes, tmp_path / "whole", to, workers=1, **options)
    folder = unfinished(to, options)
    change(folder / name)
    exports.export(pushes, tmp_path / "out", to, resume=True, workers=1, **options)
    assert same_files(tmp_path / "out", tmp_path / "whole")


@pytest.mark.parametrize("name", [".zattrs", "data/tactile/.zarray", "meta/episode_ends/0"])
def test_a_description_that_has_changed_is_named(unfinished, pushes, tmp_path, capsys, name):
    path = unfinished("zarr", {}) / name
    os.truncate(path, path.stat().st_size // 2)
    words = [str(pushes), str(tmp_path / "out"), "--to", "zarr", "--quiet"]
    assert exports.main([*words, "--resume"]) == 3
    said = capsys.readouterr().err
    assert f"'{path}' is damaged: it has" in said and "out.part and export the data set" in said
    assert exports.main(words) == 0


def test_processes_of_a_scheduler_share_the_work(pushes, tmp_path, monkeypatch):
    many_parts(monkeypatch)
    exports.export(pushes, tmp_path / "whole", "zarr")
    out = tmp_path / "out"
    variables = [{"SLURM_PROCID": str(k), "SLURM_STEP_NUM_TASKS": "2"} for k in range(2)]
    processes = [start(pushes, out, "", 0, **rank) for rank in variables]
    said = [process.communicate() for process in processes]
    assert [process.returncode for process in processes] == [0, 0], said
    assert any("20 episodes" in text for text, _ in said), said
    assert same_files(out, tmp_path / "whole")
    monkeypatch.setenv("TANGERE_WORKER", "3")
    monkeypatch.setenv("TANGERE_WORKERS", "3")
    with pytest.raises(tangere.InputError, match="TANGERE_WORKER says number 3 of 3"):
        exports.export(pushes, tmp_path / "none", "zarr")


def test_processes_do_not_mix_two_exports(pushes, tmp_path, monkeypatch):
    monkeypatch.setenv("TANGERE_WORKER", "0")
    monkeypatch.setenv("TANGERE_WORKERS", "2")
    from tangere._export_frames import Frames
    from tangere._export_zarr import Zarr
    from tangere.data import Episodes

    format = Zarr(Frames(Episodes(pushes), range(20)))
    other = _export_job.Folder(tmp_path / "out", format, "of another", False, [])
    with other.shared():
        with pytest.raises(tangere.InputError, match="by another process, with other options"):
            exports.export(pushes, tmp_path / "out", "zarr")


def test_a_process_that_fails_tells_why(pushes, spoil, tmp_path, monkeypatch):
    import shutil

    many_parts(monkeypatch)
    copy = tmp_path / "damaged"
    shutil.copytree(pushes, copy)
    spoil(copy)
    with pytest.raises(tangere.InputError, match="demo_7 has a number in 'tactile' that is not"):
        exports.export(copy, tmp_path / "out", "zarr", workers=2)
    assert [path.name for path in tmp_path.iterdir()] == ["damaged"]


def test_a_process_that_does_not_start_is_told(pushes, tmp_path, monkeypatch):
    many_parts(monkeypatch)
    monkeypatch.setattr(sys, "executable", str(tmp_path / "python"))
    with pytest.raises(FileNotFoundError):
        exports.export(pushes, tmp_path / "out", "zarr", workers=2)
    assert not list(tmp_path.iterdir())


@pytest.mark.parametrize("to, workers", [("lerobot", 1), ("zarr", 1), ("zarr", 2), ("csv", 1)])
def test_a_full_disk_is_named(pushes, command, tmp_path, to, workers):
    def limit():  # of a file, which a full disk is for one that writes
        resource.setrlimit(resource.RLIMIT_FSIZE, (2000, 2000))

    words = [sys.executable, "-m", "tangere.export", pushes, tmp_path / "out", "--to", to]
    run = subprocess.run(
        [*words, "--workers", str(workers)] if to != "csv" else words,
        env=os.environ | {"PYTHONPATH": os.pathsep.join(p for p in sys.path if p)},
        preexec_fn=limit, capture_output=True, text=True,
    )  # fmt: skip
    assert run.returncode == 3 and str(tmp_path / "out") in run.stderr, run.stderr
    assert not list(tmp_path.iterdir())


def test_a_folder_that_is_no_export_keeps_its_files(pushes, tmp_path):
    mine = tmp_path / "out.part"
    mine.mkdir()
    (mine / "notes.txt").write_text("mine")
    with pytest.raises(tangere.InputError, match="is no unfinished export"):
        exports.export(pushes, tmp_path / "out", "zarr")
    assert (mine / "notes.txt").read_text() == "mine"


def test_what_a_format_does_not_have_is_told(pushes, generate, tmp_path):
    bare = generate("dummy", "--episodes", "1")
    for data, to, options, message in (
        (pushes, "rlds", {}, "to 'rlds'; expected one of lerobot, zarr"),
        (pushes, "zarr", {"fps": 3}, "zarr has no option 'fps'; it has privileged"),
        (pushes, "csv", {"mask": "train"}, "csv has no option 'mask'"),
        (pushes, "ftp1", {"joints": "elbow"}, "joints 'elbow'; expected names of q: hand_turn"),
        (pushes, "ftp1", {"hand": "elbow"}, "hand 'elbow'; expected names of q: hand_turn"),
        (pushes, "ftp1", {"hand": "goal=3"}, "hand 'goal', an observation; expected names of q"),
        (pushes, "ftp1", {"hand": "hand_turn=32"}, "hand 'hand_turn=32'; expected NAME=NUMBER"),
        (pushes, "ftp1", {"hand": "hand_turn=1,box.x"}, "hand 'box.x'; expected NAME=NUMBER"),
        (pushes, "ftp1", {"side": "top"}, "side 'top'; expected left or right"),
        (pushes, "zarr", {"workers": 0}, "workers 0"),
        (bare, "ftp1", {}, "no reading of a sensor for FTP-1"),
        (bare, "univtac", {}, "no reading of a sensor for UniVTAC"),
    ):
        with pytest.raises(tangere.InputError, match=message):
            exports.export(data, tmp_path / "out", to, **options)
    assert not list(tmp_path.iterdir())
    (tmp_path / "mine").mkdir()
    with pytest.raises(tangere.InputError, match="is no Zarr data set; it is not overwritten"):
        exports.export(pushes, tmp_path / "mine", "zarr", overwrite=True)


def test_a_library_that_is_missing_is_named(pushes, tmp_path, monkeypatch):
    for to, module, package in (("univtac", "PIL", "pillow"), ("zarr", "zarr", "zarr")):
        monkeypatch.delitem(sys.modules, f"tangere._export_{to}", raising=False)
        monkeypatch.setitem(sys.modules, module, None)
        with pytest.raises(tangere.IoError, match=f"expected it from `pip install {package}`"):
            exports.export(pushes, tmp_path / "out", to)
    assert not list(tmp_path.iterdir())


def test_csv_is_that_of_the_command(pushes, command, tmp_path):
    done = exports.export(pushes, tmp_path / "python.csv", "csv")
    words = [command, "export", pushes, tmp_path / "command.csv", "--to", "csv"]
    subprocess.run(words, check=True, capture_output=True)
    assert filecmp.cmp(tmp_path / "python.csv", tmp_path / "command.csv", shallow=False)
    assert filecmp.cmp(tmp_path / "python.csv.json", tmp_path / "command.csv.json", shallow=False)
    assert done.frames == 2000 and done.complete


def test_a_table_names_the_readings_of_a_window(generate, command, tmp_path):
    data = generate(str(tangere.scenes()["rolling_ball_small"]), "--episodes", "1", "--steps", "60",
                    "--every", "20", "--record", "q,pad.sum/5")  # fmt: skip
    exports.export(data, tmp_path / "out.csv", "csv")
    names, *lines = (tmp_path / "out.csv").read_text().splitlines()
    said = json.loads((tmp_path / "out.csv.json").read_text())
    assert (said["episodes"], said["frames"], said["seed"]) == (1, 3, "0") and len(lines) == 3
    units = dict(zip(said["columns"], said["units"], strict=True))
    assert list(units) == names.split(",") and units["q/pad_joint.x"] == "m"
    assert [units[f"pad.sum[-3]/{k}"] for k in range(6)] == ["N"] * 3 + ["m"] * 3
    columns = dict(zip(names.split(","), np.array([line.split(",") for line in lines], float).T))
    window = stored(data, "obs/pad.sum")  # (rows, 4 readings, 6)
    assert window.shape == (3, 4, 6)
    for reading in range(4):
        for k in range(6):
            found = columns[f"pad.sum[{reading - 3}]/{k}"]
            np.testing.assert_allclose(found, window[:, reading, k], rtol=1e-6)
    assert "q/pad_joint.x" in columns and not any("[-4]" in name for name in columns)


def test_a_table_of_any_name_is_known(pushes, command, tmp_path):
    table, facts = tmp_path / "table", tmp_path / "table.json"

    def run(*words):
        done = subprocess.run([command, *words], capture_output=True, text=True)
        return done.returncode, done.stdout + done.stderr

    exports.export(pushes, table, "csv")
    code, text = run("info", table)
    assert code == 0 and "actions/drive[0] () number [1]" in text
    assert "goal/1 () number [m]" in text and "goal/2 () number [rad]" in text
    assert "generate box_pushing" in text and "a frame lasts 0.025 s" in text
    assert run("validate", table)[0] == 0
    flip_middle(table)
    code, text = run("validate", table)
    assert code == 3 and "the checksum of its bytes is" in text
    exports.export(pushes, table, "csv", overwrite=True)
    assert run("validate", table)[0] == 0
    facts.unlink()  # a table alone
    code, text = run("validate", table)
    assert code == 0 and "table.json' is missing" in text
    facts.write_text("{}")
    with pytest.raises(tangere.InputError, match="table.json' is not what"):
        exports.export(pushes, table, "csv", overwrite=True)
    table.unlink()
    with pytest.raises(tangere.IoError, match="table.json' exists already"):
        exports.export(pushes, table, "csv")
    assert facts.read_text() == "{}" and not table.exists()


@pytest.fixture(scope="module")
def mugs(generate):
    return generate(str(tangere.scenes()["mug"]), "--episodes", "1", "--steps", "20", "--every",
                    "5", "--record", "q,left_finger.sum,left_finger")  # fmt: skip


@pytest.mark.parametrize("to", ["lerobot", "zarr", "ftp1", "univtac", "csv"])
def test_actions_have_the_units_of_the_motors(mugs, command, tmp_path, to):
    exports.export(mugs, tmp_path / "out", to, **({} if to == "csv" else {"workers": 1}))
    run = subprocess.run([command, "info", tmp_path / "out", "--json"], capture_output=True)
    units = {array["name"]: array["unit"] for array in json.loads(run.stdout)["arrays"]}
    found = {name: unit for name, unit in units.items() if "action" in name}
    assert set(found.values()) == {"m"} and len(found) == (3 if to == "csv" else 1)


@pytest.mark.parametrize("to", ["zarr", "csv"])
def test_input_that_is_missing_has_one_exit_code(pushes, command, tmp_path, to):
    (tmp_path / "empty").mkdir()
    (tmp_path / "other.h5").write_bytes(b"")
    environment = os.environ | {"TANGERE_PYTHON": sys.executable}
    for name in ("none", "empty", "other.h5"):
        words = [command, "export", tmp_path / name, tmp_path / "out", "--to", to]
        run = subprocess.run(words, capture_output=True, text=True, env=environment)
        assert run.returncode == 3 and str(tmp_path / name) in run.stderr, run.stderr


def test_quiet_prints_errors_alone(pushes, command, tmp_path):
    environment = os.environ | {"TANGERE_PYTHON": sys.executable}
    for words in (
        ["export", pushes, tmp_path / "out", "--to", "lerobot"],
        ["export", pushes, tmp_path / "out.csv", "--to", "csv"],
        ["info", tmp_path / "out"],
        ["validate", tmp_path / "out"],
        ["view", tmp_path / "out", "-o", tmp_path / "page.html"],
    ):
        run = subprocess.run([command, *words, "--quiet"], env=environment, capture_output=True)
        assert (run.returncode, run.stdout, run.stderr) == (0, b"", b""), words


def test_the_command_is_the_same_code(pushes, command, tmp_path):
    environment = os.environ | {"TANGERE_PYTHON": sys.executable}
    words = [command, "export", pushes, tmp_path / "command", "--to", "zarr", "--json"]
    run = subprocess.run(words, env=environment, capture_output=True, text=True)
    said = json.loads(run.stdout)
    assert run.returncode == 0 and said["frames"] == 2000 and said["complete"], run.stderr
    exports.export(pushes, tmp_path / "python", "zarr")
    assert same_files(tmp_path / "command", tmp_path / "python")
    run = subprocess.run(words, env=environment, capture_output=True, text=True)
    assert run.returncode == 3 and "exists" in json.loads(run.stdout)["error"]


def test_the_command_names_what_is_missing(pushes, command, tmp_path):
    def run(*words, **variables):
        done = subprocess.run([command, "export", pushes, *words], capture_output=True, text=True,
                              env=os.environ | variables, cwd=tmp_path)  # fmt: skip
        return done.returncode, done.stderr

    assert run("out", "--to", "zarr", TANGERE_PYTHON="no-python")[0] == 3
    assert (
        "'no-python' cannot be started" in run("out", "--to", "zarr", TANGERE_PYTHON="no-python")[1]
    )
    assert run("out", "--to", "zar") == (2, "tangere: unknown format 'zar'; did you mean 'zarr'?\n")
    for words, message in (
        (["out"], "out without --to; expected --to lerobot, zarr"),
        ([], "expected OUT with --to FORMAT, or --csv F.csv"),
        (["--csv", "a.csv", "--touch", "state"], "--touch of a table"),
        (["--csv", "a.csv", "--to", "zarr"], "--to zarr with --csv"),
        (["out", "--to", "zarr", "--episode", "3"], "--episode 3 with --to zarr"),
    ):
        code, err = run(*words)
        assert code == 2 and message in err, err
    assert not list(tmp_path.iterdir())


def test_the_command_has_the_options_of_the_package(command):
    parser = exports._parser("x")
    exports._add_format_options(parser)
    package = {s for a in parser._actions for s in a.option_strings if s.startswith("--")}
    text = subprocess.run([command, "export", "--help"], capture_output=True, text=True).stdout
    program = set(re.findall(r"^  (?:-\w,)?(--[a-z-]+)", text, re.MULTILINE))
    assert program - package == {"--csv", "--episode", "--verbose"}
    assert package - program == set()
