# SPDX-License-Identifier: Apache-2.0
"""Data sets by the tasks of a Ray cluster: `tangere generate --shard` in each.

    import ray, tangere.ray
    ray.init("auto")
    done = tangere.ray.generate("box_pushing", "/shared/pushes", 100_000)

Needs the package ray, and a folder that all nodes see. A task makes one shard, so a worker that
dies loses one at most: Ray starts the task again, elsewhere if need be, and `--resume` keeps what
is complete. The bytes are those of one process.
"""

from __future__ import annotations

import os
from pathlib import Path
from typing import Any, Callable, Sequence

from . import _core
from ._generate import run_command

__all__ = ["generate"]

_RETRIES = 20  # of a task whose worker or node dies


def generate(
    what: str | Path,
    output: str | Path,
    episodes: int,
    *,
    shards: int | None = None,
    seed: int = 0,
    policy: str | None = None,
    threads: int = 1,
    options: Sequence[str] = (),
    retries: int = _RETRIES,
    progress: Callable[[int, int], None] | None = None,
    task_options: dict[str, Any] | None = None,
) -> dict[str, Any]:
    """Makes a data set with the tasks of the cluster that `ray.init` has joined.

    Parameters
    ----------
    what: a task's name or the path of a scene, which all nodes see.
    output: folder of the data set, which all nodes see.
    shards: files, and tasks. None: as many as `tangere generate` takes, at least one for each two
        processors of the cluster while a shard has 16 episodes or more.
    policy: a name, such as "random". None: the script of the task, the controls of a scene.
    threads: of each task, which reserves as many processors.
    options: more words of the command, such as ("--compress", "deflate").
    retries: of a task whose worker dies; an error of the command is not tried again.
    progress: called with shards that are complete and all shards.
    task_options: for `ray.remote`, such as {"resources": {"simulation": 1}}.

    Returns what `tangere merge` says: "output", "demos", "failed" … Raises InputError and IoError
    as the command does, IoError without ray or if a task is lost after all retries.
    """
    ray = _ray()
    if isinstance(options, str):
        raise _core.InputError(f"options {options!r}; expected a list, such as [{options!r}]")
    if episodes < 1 or threads < 1 or (shards is not None and shards < 1):
        raise _core.InputError(
            f"episodes {episodes}, threads {threads}, shards {shards}; expected 1 or above"
        )
    if not ray.is_initialized():
        ray.init()
    blocks = -(-episodes // 16)
    if shards is None:
        processors = int(ray.cluster_resources().get("CPU", 1))
        shards = min(blocks, max(4 * processors // threads, -(-blocks // 256)))
    words = ["generate", str(what), "--output", str(Path(output).absolute())]
    words += ["--episodes", str(episodes), "--seed", str(seed), "--threads", str(threads)]
    words += ["--policy", policy] if policy is not None else []
    words += [*options, "--resume", "--no-merge", "--quiet"]
    run_command([*words, "--shards", str(shards), "--dry-run"])  # mistakes, before any task starts
    remote = ray.remote(**{"num_cpus": threads, "max_retries": retries} | (task_options or {}))(
        _shard
    )
    waiting = [remote.remote([*words, "--shard", f"{shard}/{shards}"]) for shard in range(shards)]
    done = 0
    try:
        while waiting:
            ready, waiting = ray.wait(waiting, num_returns=1)
            said = ray.get(ready[0])
            if "error" in said:
                raise (_core.InputError if said["code"] == 2 else _core.IoError)(said["error"])
            done += 1
            if progress:
                progress(done, shards)
    except ray.exceptions.RayError as error:
        raise _core.IoError(
            f"a task of {shards} is lost after {retries} retries: {error}"
        ) from None
    finally:
        for task in waiting:
            ray.cancel(task, force=True)
    return run_command(["merge", str(output), "--overwrite"])


def _shard(words: list[str]) -> dict[str, Any]:
    """What a task does. Variables of a scheduler that started Ray are not those of the task."""
    os.environ |= {"TANGERE_WORKER": "0", "TANGERE_WORKERS": "1"}
    try:
        return run_command(words, dies_along=True)  # so that no orphan writes the shard
    except (_core.InputError, _core.IoError) as error:  # which a cluster need not unpickle
        return {"error": str(error), "code": 2 if isinstance(error, _core.InputError) else 3}


def _ray() -> Any:
    try:
        import ray
    except ImportError:
        raise _core.IoError(
            "tangere.ray without the package ray; expected it from `pip install ray`"
        ) from None
    return ray
