# SPDX-License-Identifier: Apache-2.0
"""Data sets of machines that share no folder: shards are made locally and moved to a destination.

    python -m tangere.store generate box_pushing s3://bucket/push --episodes 40000 --shards 400
    python -m tangere.store merge s3://bucket/push push

The first command runs on every machine, as often as you like, under any scheduler that `tangere
generate` knows: each process makes the shards of its number that the destination lacks. The second
one fetches the shards and merges them.

A destination is a folder, a URL that fsspec opens (s3://, gs://, sftp:// …), or `put`, a command of
yours. Nothing has the name of a shard before it is whole: object stores show what is complete, and
elsewhere a file is called shard-….h5.part until then.
"""

from __future__ import annotations

import argparse
import json
import os
import shlex
import shutil
import subprocess
import sys
import tempfile
from pathlib import Path
from typing import Any, Callable, Protocol, Sequence

from . import __version__, _core
from ._generate import run_command

__all__ = ["generate", "main", "merge"]

_JOB = "tangere.json"  # at the destination: what its shards are
_WHOLE = ("s3", "s3a", "gs", "gcs", "abfs", "az", "oss", "memory")  # show complete objects alone


class Place(Protocol):
    """Where shards go."""

    def sizes(self) -> dict[str, int]:
        """NAME → bytes of what is there."""

    def read(self, name: str) -> bytes: ...

    def put(self, path: Path) -> None:
        """Moves a file there, under its name, whole or not at all."""

    def get(self, name: str, path: Path) -> None: ...


class _Folder:
    def __init__(self, path: Path):
        self._path = path

    def sizes(self) -> dict[str, int]:
        return {p.name: p.stat().st_size for p in self._path.glob("*") if p.is_file()}

    def read(self, name: str) -> bytes:
        return (self._path / name).read_bytes()

    def put(self, path: Path) -> None:
        self._path.mkdir(parents=True, exist_ok=True)
        part = self._path / f"{path.name}.{os.uname().nodename}.{os.getpid()}.part"
        try:
            with open(path, "rb") as source, open(part, "wb") as target:
                shutil.copyfileobj(source, target, 1 << 20)
                target.flush()
                os.fsync(target.fileno())
            part.rename(self._path / path.name)
        finally:
            part.unlink(missing_ok=True)

    def get(self, name: str, path: Path) -> None:
        shutil.copyfile(self._path / name, path)


class _Url:
    def __init__(self, url: str, options: dict[str, Any]):
        try:
            import fsspec

            self._system, root = fsspec.core.url_to_fs(url, **options)
        except ImportError as error:
            raise _core.IoError(
                f"{url} needs the package {error.name or error}; expected it from `pip install "
                "fsspec`, and for s3:// s3fs"
            ) from None
        except ValueError as error:
            raise _core.InputError(
                f"{url}: {error}; expected a folder or a URL of fsspec"
            ) from None
        self._root = root.rstrip("/")
        self._whole = url.split("://")[0] in _WHOLE

    def sizes(self) -> dict[str, int]:
        self._system.invalidate_cache()
        try:
            found = self._system.ls(self._root, detail=True)
        except FileNotFoundError:
            return {}
        return {
            one["name"].rsplit("/", 1)[1]: int(one["size"]) for one in found
            if one["type"] == "file" and "/" in one["name"]
        }  # fmt: skip

    def read(self, name: str) -> bytes:
        return bytes(self._system.cat_file(f"{self._root}/{name}"))

    def put(self, path: Path) -> None:
        final = f"{self._root}/{path.name}"
        if self._whole:
            self._system.put_file(str(path), final)
            return
        self._system.makedirs(self._root, exist_ok=True)
        part = f"{final}.{os.uname().nodename}.{os.getpid()}.part"
        self._system.put_file(str(path), part)
        self._system.mv(part, final)

    def get(self, name: str, path: Path) -> None:
        self._system.get_file(f"{self._root}/{name}", str(path))


def _place(destination: str | Path, options: dict[str, Any] | None) -> Place:
    text = str(destination)
    if "://" in text and not text.startswith("file://"):
        return _Url(text, options or {})
    return _Folder(Path(text.removeprefix("file://")))


def generate(
    what: str | Path,
    destination: str | Path,
    episodes: int,
    shards: int,
    *,
    seed: int = 0,
    options: Sequence[str] = (),
    put: str | None = None,
    scratch: str | Path | None = None,
    storage: dict[str, Any] | None = None,
    progress: Callable[[int, int], None] | None = None,
) -> dict[str, Any]:
    """Makes this process' share of a data set's shards and moves each to `destination`.

    Parameters
    ----------
    what: a task's name or the path of a scene.
    destination: a folder, or a URL of fsspec such as s3://bucket/push. Shards that are there stay.
    shards: files of the data set. Process k of n makes shards k, k + n …; k and n come from a
        scheduler, as for `tangere generate`.
    options: more words of the command, such as ("--policy", "random", "--threads", "4").
    put: a command that takes a shard away in place of `destination`, which then keeps its list
        alone, such as "rclone copyto {path} remote:push/{name}". Code 0 means that it is there.
    scratch: a local folder for the shard that is being made. None: a temporary one.
    storage: options of fsspec for the URL.
    progress: called with shards that are done and all shards of this process.

    Returns "made" and "kept", numbers of shards, and "process" and "processes". Raises InputError
    if the destination has shards of other settings, IoError if a shard cannot be made or moved.
    """
    if isinstance(options, str):
        raise _core.InputError(f"options {options!r}; expected a list, such as [{options!r}]")
    if put is not None:
        try:
            shlex.split(put)
        except ValueError as error:
            raise _core.InputError(
                f"put {put!r}: {error}; expected a command as a shell has it"
            ) from None
    if shards < 1 or episodes < 1:
        raise _core.InputError(f"episodes {episodes}, shards {shards}; expected 1 or above")
    index, count, _ = _core.worker_from_environment()
    place = _place(destination, storage)
    words = ["generate", str(what), "--episodes", str(episodes), "--seed", str(seed), *options]
    with tempfile.TemporaryDirectory(dir=scratch, prefix="tangere-") as folder:  # refuses mistakes
        run_command([*words, "--output", folder, "--shards", str(shards), "--dry-run", "--quiet"])
    job = {
        "words": words, "shards": shards, "tangere_version": __version__,
        "instruction_set": _core.instruction_set,
    }  # fmt: skip
    agreed = _agrees(place, str(destination), job)
    mine = range(index, shards, count)
    said = {"made": 0, "kept": 0, "process": index, "processes": count}
    with tempfile.TemporaryDirectory(dir=scratch, prefix="tangere-") as folder:
        there = _listed(place, put)
        for done, shard in enumerate(mine):
            if progress:
                progress(done, len(mine))
            name = f"shard-{shard:05d}.h5"
            if name in there:
                said["kept"] += 1
                continue
            run_command([
                *words, "--output", folder, "--shard", f"{shard}/{shards}", "--no-merge", "--quiet",
                "--resume",
            ])  # fmt: skip
            if not agreed:  # no sooner, so that what is refused leaves nothing there
                _claim(place, str(destination), job)
                agreed = True
            path = Path(folder) / name
            _move(place, path, put)
            path.unlink()
            said["made"] += 1
    if progress:
        progress(len(mine), len(mine))
    return said


def merge(
    destination: str | Path, folder: str | Path, *, storage: dict[str, Any] | None = None,
    progress: Callable[[int, int], None] | None = None,
) -> dict[str, Any]:  # fmt: skip
    """Fetches the shards of a destination into `folder` and merges them there.

    Shards that the folder has in the same size are not fetched again, so a call that was
    interrupted goes on. Returns what `tangere merge` says. Raises IoError if a shard is missing,
    cannot be fetched or is damaged.
    """
    place = _place(destination, storage)
    sizes = place.sizes()
    if _JOB not in sizes:
        raise _core.InputError(f"{destination}: no {_JOB}; expected a destination of tangere.store")
    shards = int(json.loads(place.read(_JOB))["shards"])
    names = [f"shard-{shard:05d}.h5" for shard in range(shards)]
    missing = [name for name in names if name not in sizes]
    if missing:
        raise _core.IoError(
            f"{destination} lacks {len(missing)} of {shards} shards, {missing[0]} first; expected "
            "all, see tangere.store.generate"
        )
    folder = Path(folder)
    folder.mkdir(parents=True, exist_ok=True)
    _keep_job(folder, place.read(_JOB), str(destination))
    for done, name in enumerate(names):
        if progress:
            progress(done, shards)
        path = folder / name
        if path.is_file() and path.stat().st_size == sizes[name]:
            continue
        part = folder / f"{name}.part"
        place.get(name, part)
        part.rename(path)
    if progress:
        progress(shards, shards)
    return run_command(["merge", str(folder), "--overwrite"])


def _keep_job(folder: Path, job: bytes, destination: str) -> None:
    """Notes what the shards of a folder are, or compares it: others may be as long."""
    text = job.decode()
    mine = folder / _JOB
    kept = mine.read_text() if mine.is_file() else None
    if kept != text and (kept is not None or any(folder.glob("shard-*.h5"))):
        raise _core.InputError(
            f"{folder} has shards of another set than {destination}; expected a new folder"
        )
    new = folder / f"{_JOB}.new"
    new.write_text(text)
    new.replace(mine)


def _agrees(place: Place, name: str, job: dict[str, Any]) -> bool:
    """Whether a destination says that its shards are these. Raises InputError if they are others,
    and is false if it says nothing yet."""
    if _JOB not in place.sizes():
        return False
    there = json.loads(place.read(_JOB))
    for key, value in job.items():
        if there.get(key) != value:
            raise _core.InputError(
                f"{name} has shards of {key} {there.get(key)!r}; expected {value!r}, or "
                "another destination"
            )
    return True


def _claim(place: Place, name: str, job: dict[str, Any]) -> None:
    """Says at a destination what its shards are, unless another process has."""
    if _agrees(place, name, job):
        return
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / _JOB
        path.write_text(json.dumps(job, indent=4) + "\n")
        place.put(path)


def _listed(place: Place, put: str | None) -> set[str]:
    """Shards that are done. A command cannot be asked, so each leaves an empty mark."""
    names = set(place.sizes())
    return (
        {name.removesuffix(".done") for name in names if name.endswith(".done")} if put else names
    )


def _move(place: Place, path: Path, put: str | None) -> None:
    if put is None:
        place.put(path)
        size = place.sizes().get(path.name)
        if size != path.stat().st_size:
            raise _core.IoError(
                f"{path.name} has {size} bytes there; expected {path.stat().st_size}"
            )
        return
    words = [
        word.replace("{path}", str(path)).replace("{name}", path.name) for word in shlex.split(put)
    ]
    run = subprocess.run(words, stdin=subprocess.DEVNULL, capture_output=True, text=True)
    if run.returncode:
        raise _core.IoError(f"{shlex.join(words)} ended with code {run.returncode}: {run.stderr}")
    mark = path.with_name(f"{path.name}.done")
    mark.touch()
    place.put(mark)
    mark.unlink()


def main(arguments: Sequence[str] | None = None) -> int:
    """The command; returns its exit code: 0 done, 2 for a mistake, 3 if a shard is not moved."""
    parser = argparse.ArgumentParser(
        prog="python -m tangere.store",
        description="Make a data set on machines that share no folder, or fetch and merge it.",
        epilog="Words after -- are more options of tangere generate.",
    )
    which = parser.add_subparsers(dest="command", required=True)
    making = which.add_parser("generate", help="make this process' shards and move them")
    making.add_argument("what", metavar="TASK|SCENE")
    making.add_argument("destination", metavar="URL", help="folder, or URL of fsspec")
    making.add_argument("--episodes", type=int, required=True, metavar="N")
    making.add_argument("--shards", type=int, required=True, metavar="S", help="files")
    making.add_argument("--seed", type=int, default=0, metavar="N")
    making.add_argument("--put", metavar="CMD", help="command that takes {path} away as {name}")
    making.add_argument("--scratch", metavar="DIR", help="local folder for a shard")
    merging = which.add_parser("merge", help="fetch all shards and merge them")
    merging.add_argument("destination", metavar="URL")
    merging.add_argument("folder", metavar="DIR")
    words = list(sys.argv[1:] if arguments is None else arguments)
    cut = words.index("--") if "--" in words else len(words)
    given = vars(parser.parse_args(words[:cut]))
    command = given.pop("command")
    if command == "generate":
        given["options"] = words[cut + 1 :]
    elif words[cut + 1 :]:
        parser.error(f"{words[cut + 1]!r} after --; expected nothing, merge takes no more words")
    try:
        said = generate(**given) if command == "generate" else merge(**given)
    except _core.InputError as error:
        print(f"tangere.store: {error}", file=sys.stderr)
        return 2
    except (_core.IoError, OSError) as error:
        print(f"tangere.store: {error}", file=sys.stderr)
        return 3
    print(json.dumps(said))
    return 0


if __name__ == "__main__":
    sys.exit(main())
