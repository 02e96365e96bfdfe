# SPDX-License-Identifier: Apache-2.0
"""Data sets by the tasks of a Ray cluster of two nodes on this machine, with workers killed."""

from __future__ import annotations

import os
import signal
from pathlib import Path

import pytest

import tangere

ray = pytest.importorskip("ray", reason="ray is not installed")
from tangere import ray as on_ray  # noqa: E402


@pytest.fixture(scope="module")
def cluster():
    from ray.cluster_utils import Cluster

    nodes = Cluster(
        initialize_head=True, head_node_args={"num_cpus": 1, "include_dashboard": False}
    )
    nodes.add_node(num_cpus=1)
    ray.init(address=nodes.address, log_to_driver=False)
    yield nodes
    ray.shutdown()
    nodes.shutdown()


def workers():
    """Processes that Ray has named after the task that they run, and that are ours."""
    found = []
    for path in Path("/proc").glob("[0-9]*/cmdline"):
        try:
            if path.read_bytes().startswith(b"ray::_shard") and path.stat().st_uid == os.getuid():
                found.append(int(path.parent.name))
        except OSError:
            continue
    return found


def test_workers_that_are_killed_change_no_byte(cluster, generate, tmp_path):
    wanted = generate("box_pushing", "--episodes", "512", "--seed", "3", "--shards", "8")
    killed, seen = [], []

    def kill(done, total):
        seen.append((done, total))
        for worker in workers()[: 1 if len(killed) < 3 else 0]:
            os.kill(worker, signal.SIGKILL)
            killed.append(worker)

    made = on_ray.generate("box_pushing", tmp_path / "set", 512, shards=8, seed=3, progress=kill)
    assert len(killed) == 3 and seen == [(k, 8) for k in range(1, 9)] and made["demos"] == 512
    for shard in range(8):
        name = f"shard-{shard:05d}.h5"
        assert (tmp_path / "set" / name).read_bytes() == (wanted / name).read_bytes(), name
    assert not list(tmp_path.glob("set/*.part"))


def test_mistakes_are_those_of_the_command(cluster, tmp_path):
    for what, options, message in (
        ("no_such_task", {}, "no_such_task"),
        ("box_pushing", {"shards": 9}, "9 shards of 64 episodes; expected at most 4"),
        ("box_pushing", {"threads": 0}, "threads 0"),
        ("box_pushing", {"options": "--quiet"}, "expected a list"),
    ):
        with pytest.raises((tangere.InputError, tangere.IoError), match=message):
            on_ray.generate(what, tmp_path / "set", 64, **options)
    assert not list(tmp_path.iterdir())
