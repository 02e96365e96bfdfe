# SPDX-License-Identifier: Apache-2.0
"""Shards that are moved to a folder, to an object store and by a command, with uploads killed."""

from __future__ import annotations

import os
import signal
import subprocess
import sys
import time

import pytest

import tangere
from tangere import store

SET = ("box_pushing", "--episodes", "64", "--seed", "3", "--shards", "4")


@pytest.fixture(scope="module")
def wanted(generate):
    folder = generate(*SET)
    return {path.name: path.read_bytes() for path in folder.glob("shard-*.h5")}


def shards_of(folder):
    return {path.name: path.read_bytes() for path in folder.glob("shard-*.h5")}


def test_shards_move_to_a_folder_and_are_merged(wanted, tmp_path, monkeypatch):
    there = tmp_path / "there"
    monkeypatch.setenv("TANGERE_WORKERS", "3")
    made = []
    for k in (2, 0, 1):
        monkeypatch.setenv("TANGERE_WORKER", str(k))
        if k == 1:
            with pytest.raises(tangere.IoError, match="lacks 1 of 4 shards, shard-00001.h5 first"):
                store.merge(there, tmp_path / "set")
        seen = []
        said = store.generate("box_pushing", there, 64, 4, seed=3,
                              progress=lambda *at: seen.append(at))  # fmt: skip
        made.append(said["made"])
        assert seen[-1] == (said["made"], said["made"]) and said["processes"] == 3
    assert made == [1, 2, 1] and shards_of(there) == wanted
    assert sorted(p.name for p in there.iterdir()) == [*sorted(wanted), "tangere.json"]
    assert store.generate("box_pushing", there, 64, 4, seed=3)["kept"] == 1
    assert store.merge(f"file://{there}", tmp_path / "set")["demos"] == 64
    assert shards_of(tmp_path / "set") == wanted and (tmp_path / "set/robomimic.hdf5").is_file()


def test_other_settings_and_mistakes_are_told(tmp_path):
    there = tmp_path / "there"
    store.generate("stable_grasp", there, 16, 1)
    for arguments, options, message in (
        (("stable_grasp", there, 16, 1), {"seed": 4}, "has shards of words"),
        (("stable_grasp", there, 17, 2), {}, "expected"),
        (("stable_grasp", there, 0, 1), {}, "episodes 0"),
        (("stable_grasp", there, 16, 1), {"options": "--quiet"}, "expected a list"),
        (("no_task", tmp_path / "none", 16, 1), {}, "no_task"),
        (("stable_grasp", tmp_path / "none", 16, 1), {"options": ["--overwrite"]}, "overwrite"),
    ):
        with pytest.raises((tangere.InputError, tangere.IoError), match=message):
            store.generate(*arguments, **options)
    assert not (tmp_path / "none").exists()  # a mistake claims nothing
    with pytest.raises(tangere.InputError, match="no tangere.json; expected a destination of"):
        store.merge(tmp_path, tmp_path / "set")
    assert store.main(["merge", str(tmp_path), str(tmp_path / "set")]) == 2
    with pytest.raises(tangere.InputError, match="No closing quotation; expected a command"):
        store.generate("stable_grasp", tmp_path / "put", 16, 1, put="cp {path'")


def test_more_words_of_the_command_stand_behind_a_line(tmp_path):
    words = ["stable_grasp", "--episodes", "16", "--shards", "1"]
    there = [str(tmp_path / name) for name in ("a", "b")]
    assert store.main(["generate", words[0], there[0], *words[1:], "--", "--threads", "1"]) == 0
    assert store.main(["generate", words[0], there[1], *words[1:], "--seed", "5"]) == 0
    with pytest.raises(SystemExit):
        store.main(["merge", there[0], str(tmp_path / "set"), "--", "--threads", "1"])
    store.merge(there[0], tmp_path / "set")
    with pytest.raises(tangere.InputError, match="has shards of another set than"):
        store.merge(there[1], tmp_path / "set")


def test_a_command_takes_shards_away(tmp_path, wanted):
    goods, list_ = tmp_path / "goods", tmp_path / "list"
    goods.mkdir()
    words = {"seed": 3, "put": f"cp {{path}} {goods}/{{name}}"}
    assert store.generate("box_pushing", list_, 64, 4, **words)["made"] == 4
    assert shards_of(goods) == wanted and not list(list_.glob("*.h5"))
    assert store.generate("box_pushing", list_, 64, 4, **words)["kept"] == 4
    with pytest.raises(tangere.IoError, match="false ended with code 1"):
        store.generate("box_pushing", tmp_path / "other", 64, 4, put="false")


@pytest.fixture(scope="module")
def bucket():
    """s3:// of a server on this machine, as a URL and options of fsspec."""
    server = pytest.importorskip("moto.server", reason="moto is not installed")
    pytest.importorskip("s3fs", reason="s3fs is not installed")
    import boto3

    running = server.ThreadedMotoServer(ip_address="127.0.0.1", port=0, verbose=False)
    running.start()
    host, port = running.get_host_and_port()
    storage = {"key": "x", "secret": "x", "endpoint_url": f"http://{host}:{port}"}
    boto3.client("s3", aws_access_key_id="x", aws_secret_access_key="x", region_name="us-east-1",
                 endpoint_url=storage["endpoint_url"]).create_bucket(Bucket="bucket")  # fmt: skip
    yield "s3://bucket/push", storage
    running.stop()


PUT = """
import sys, tangere.store as store
store.generate("box_pushing", sys.argv[1], 64, 4, seed=3, storage=eval(sys.argv[2]))
"""


def test_uploads_that_are_killed_leave_nothing_under_a_name(bucket, wanted, tmp_path):
    import s3fs

    url, storage = bucket
    system = s3fs.S3FileSystem(**storage, use_listings_cache=False)
    path = os.pathsep.join(p for p in sys.path if p)
    kills = int(os.environ.get("TANGERE_STORE_KILLS", "3"))
    for killed in range(kills + 1):
        words = [sys.executable, "-c", PUT, url, repr(storage)]
        with subprocess.Popen(words, env=os.environ | {"PYTHONPATH": path}) as process:
            try:
                code = process.wait(1.2 + 0.35 * (killed % 7) if killed < kills else 60)
                assert code == 0
            except subprocess.TimeoutExpired:
                process.send_signal(signal.SIGKILL)
        time.sleep(0.1)
        for name in system.ls(url) if system.exists(url) else []:
            final = name.rsplit("/", 1)[1]
            if final.startswith("shard-"):
                assert system.cat_file(name) == wanted[final], final
    assert store.merge(url, tmp_path / "set", storage=storage)["demos"] == 64
    assert shards_of(tmp_path / "set") == wanted
