# SPDX-License-Identifier: Apache-2.0
"""The folder of an export and its parts: what all formats share.

A format cuts its frames into parts, which follow from the data set and the options alone. Each part
is written by one process, so the bytes do not depend on how many there are. The files of the data
set are compared with their checksums beside that. A folder is called OUTPUT.part until all parts
are there and all files are whole:

    .lock          held exclusively by a process that is alone or finishes, else shared
    .start         held for a moment by a process that begins or ends
    .parts/job.json    what the bytes depend on, and sums of the files that were there first
    .parts/00003       part 3 is complete
    .parts/00003.npz   what the format's `finish` needs of it, if anything
    .parts/00003.sums  sizes and sums of its files, and of the one above
    .parts/whole-00002 the numbers of file 2 of the data set have its checksum

A run that was stopped or killed leaves OUTPUT.part. The next one goes on with it if it writes the
same, and is told to or is one of many processes of a scheduler; otherwise it removes it. Parts
whose files no longer have their sums are written again.
"""

from __future__ import annotations

import fcntl
import hashlib
import json
import os
import shutil
import threading
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Callable, Collection, Iterator, Protocol

from . import _core
from ._export_pool import Pool
from ._export_sums import Sums, joined, stored, file_sums

Progress = Callable[[int, int], None]  # frames that are written, frames of this process


class Format(Protocol):
    """How the frames of a data set become files. It is pickled for the processes that write."""

    sign: str  #: a file that a complete folder has, removed first
    origin: str  #: a file of JSON that says where the data come from
    kind: str  #: what such a folder is, for messages
    parts: list[int]  #: frames of each
    names: list[str]  #: of its arrays
    fps: int  #: frames a second
    folder_keys: bool  #: whether its files are counted for each folder
    common: list[str]  #: files that belong to no part, of those that have sums

    def job(self) -> dict[str, Any]:
        """All that the bytes depend on, without the data set."""

    def begin(self, folder: Path) -> None:
        """Prepares the empty folder, before any part."""

    def write(self, folder: Path, part: int) -> None:
        """Writes a part. It may find files of it that a killed run has left."""

    def files(self, part: int) -> list[str]:
        """Those that `write` makes of a part, below the folder; some need not be there."""

    def finish(self, folder: Path) -> None:
        """Joins the parts; they are all there."""


def identity(job: dict[str, Any]) -> str:
    """A name of what is written: the same for the same bytes."""
    text = json.dumps(job, sort_keys=True, default=str)
    return hashlib.sha256(text.encode()).hexdigest()[:32]


@dataclass
class Work:
    """What processes do for an export: they check files of the data set, and write parts."""

    format: Format
    sources: list[Path]  #: files of the data set
    folder: Path  #: OUTPUT.part

    def tasks(self) -> list[str]:
        """Checks come first, so that damage is found early."""
        checks = [f"whole-{number:05d}" for number in range(len(self.sources))]
        return checks + [f"{part:05d}" for part in range(len(self.format.parts))]

    def frames(self, task: str) -> int:
        """That a task writes."""
        return self.format.parts[int(task)] if task.isdecimal() else 0

    def do(self, task: str) -> None:
        if task.isdecimal():
            try:
                self.format.write(self.folder, int(task))
                self._sums_file(task).write_text(json.dumps(self._found(task)))
            except OSError as error:
                raise named(error, self.folder) from None
            return
        try:
            _core.check_shard(self.sources[int(task.removeprefix("whole-"))])
        except _core.IoError as error:
            raise _core.IoError(
                f"{error}; remove the file, and make it again with the command of the data set and "
                "--resume"
            ) from None

    def sums(self) -> Sums:
        """Of all files, after `Format.finish`."""
        parts = [self._stored(task) for task in self.tasks() if task.isdecimal()]
        common = file_sums(self.folder, self.format.common, self.format.folder_keys)
        return joined([*(part["files"] for part in parts), common])

    def has_sums(self, task: str) -> bool:
        """Whether what `sums` needs of a task is there. A part of an older version has none."""
        return not task.isdecimal() or bool(self._stored(task))

    def is_whole(self, task: str) -> bool:
        """Whether the files of a part that was written are as they were."""
        return not task.isdecimal() or self._stored(task) == self._found(task)

    def remove(self, task: str) -> None:
        """Removes the files of a part, so that nothing of them is kept when it is written again."""
        beside = (f".parts/{task}{end}" for end in ("", ".sums", ".npz"))
        for name in (*self.format.files(int(task)), *beside):
            (self.folder / name).unlink(missing_ok=True)

    def _found(self, task: str) -> dict[str, Sums]:
        files = file_sums(self.folder, self.format.files(int(task)), self.format.folder_keys)
        return {"files": files, "beside": file_sums(self.folder, [f".parts/{task}.npz"], False)}

    def _stored(self, task: str) -> dict[str, Sums]:
        """What `do` has stored of a part; nothing if that is missing or damaged."""
        try:
            said = json.loads(self._sums_file(task).read_text(encoding="utf-8"))
            return {
                group: {path: (files, size, total) for path, (files, size, total) in sums.items()}
                for group, sums in ((group, said[group]) for group in ("files", "beside"))
            }
        except (OSError, ValueError, KeyError, TypeError, AttributeError):
            return {}

    def _sums_file(self, part: str) -> Path:
        return self.folder / f".parts/{part}.sums"


def run(
    format: Format, job: dict[str, Any], output: Path, *, sources: list[Path], overwrite: bool,
    resume: bool, workers: int, progress: Progress | None,
) -> bool:  # fmt: skip
    """Writes `output`. Returns whether it is complete: if other processes write parts of it, the
    one that ends last completes it.

    `sources`: files of the data set. Raises IoError if the numbers of one of them do not have its
    checksum, and if `output` is there and is not to be replaced; InputError if it is of another
    kind, and if other processes write something else there.
    """
    folder = Folder(output, format, identity(job), overwrite, sources)
    try:
        return _run(folder, resume, workers, progress)
    except OSError as error:
        raise named(error, folder.part) from None


def _run(folder: Folder, resume: bool, workers: int, progress: Progress | None) -> bool:
    index, count, _ = _core.worker_from_environment()
    if (resume or count > 1) and folder.is_done():
        folder.remove_old()
        return True
    if count == 1:
        with folder.alone(resume):
            _do(folder, folder.work.tasks(), workers, progress)
            folder.finish()
        return True
    try:
        with folder.shared():
            _do(folder, folder.work.tasks()[index::count], workers, progress)
        return folder.finish_if_last()
    except (FileNotFoundError, _core.InputError, _core.IoError):
        if folder.is_done():  # another process has completed it meanwhile
            return True
        raise


def _do(folder: Folder, tasks: list[str], workers: int, progress: Progress | None) -> None:
    work = folder.work
    for task in tasks:
        if folder.has(task) and not work.is_whole(task):
            work.remove(task)
    wanted = [task for task in tasks if not folder.has(task)]
    total = sum(map(work.frames, tasks))
    done = total - sum(map(work.frames, wanted))
    lock = threading.Lock()

    def end(task: str) -> None:
        nonlocal done
        folder.mark(task)
        with lock:
            done += work.frames(task)
            if progress:
                progress(done, total)

    if progress:
        progress(done, total)
    processes = min(workers, len(wanted))
    if processes <= 1:
        for task in wanted:
            work.do(task)
            end(task)
        return
    Pool(work, processes, folder.lock).run(wanted, end)


class Folder:
    """OUTPUT.part and how it gets its name."""

    def __init__(
        self, output: Path, format: Format, name: str, overwrite: bool, sources: list[Path]
    ):
        self.output, self._format, self._name, self._overwrite = output, format, name, overwrite
        self.lock = -1  # the descriptor of the lock, while it is held
        self.part, self._old = (
            output.with_name(output.name + end) for end in (".part", ".old.part")
        )
        self.work = Work(format, sources, self.part)

    def is_done(self) -> bool:
        """Whether `output` is complete and what this job writes."""
        path = self.output / self._format.origin
        if not (self.output / self._format.sign).is_file() or not path.is_file():
            return False
        return _job_in(path) == self._name

    def remove_old(self) -> None:
        """Removes what a run left that was killed after it gave `output` its name."""
        if self._old.exists() and self.output.exists():
            shutil.rmtree(self._old, ignore_errors=True)

    def has(self, task: str) -> bool:
        return (self.part / ".parts" / task).is_file() and self.work.has_sums(task)

    def mark(self, task: str) -> None:
        (self.part / ".parts" / task).touch()

    def _left(self) -> list[str]:
        return [task for task in self.work.tasks() if not self.has(task)]

    @contextmanager
    def alone(self, resume: bool) -> Iterator[None]:
        """Holds the folder. If anything but a stop fails, it is removed."""
        self._check_free()
        self._check_part()
        self.part.mkdir(parents=True, exist_ok=True)
        with open(self.part / ".lock", "w") as lock:
            if not _locked(lock, fcntl.LOCK_EX):
                raise _core.InputError(f"{self.part} is being written by another process")
            if resume and self._job() == self._name:
                self._check_begun()
            try:
                self.lock = lock.fileno()
                self._begin(resume)
                yield
            except (KeyboardInterrupt, SystemExit):  # stopped: the parts stay for the next run
                self._put_back()
                raise
            except BaseException:
                shutil.rmtree(self.part, ignore_errors=True)
                self._put_back()
                raise

    @contextmanager
    def shared(self) -> Iterator[None]:
        """Holds the folder together with others that write the same."""
        self._check_free()
        self._check_part()
        self.part.mkdir(parents=True, exist_ok=True)
        with open(self.part / ".lock", "w") as lock:
            with open(self.part / ".start", "w") as start:
                fcntl.flock(start, fcntl.LOCK_EX)
                if self._job() == self._name:
                    self._check_begun()
                else:
                    if not _locked(lock, fcntl.LOCK_EX):
                        raise _core.InputError(
                            f"{self.part} is being written by another process, with other options "
                            "or of another data set"
                        )
                    self._begin(resume=False)
                fcntl.flock(lock, fcntl.LOCK_SH)
            self.lock = lock.fileno()
            yield

    def finish_if_last(self) -> bool:
        """Whether this process, or one before it, has completed `output`."""
        if not self.part.is_dir():
            return self.is_done()
        with open(self.part / ".start", "w") as start, open(self.part / ".lock", "w") as lock:
            fcntl.flock(start, fcntl.LOCK_EX)
            if not self.part.is_dir() or self._job() != self._name:
                return self.is_done()
            if self._left():
                return False
            if not _locked(lock, fcntl.LOCK_EX):
                return False  # another process ends soon, and finishes
            self.finish()
        return True

    def finish(self) -> None:
        """Joins the parts and gives the folder its name."""
        if left := self._left():
            raise _core.IoError(f"part {left[0]} of {self.output} was not written")
        self._format.finish(self.part)
        path = self.part / self._format.origin
        try:
            said = json.loads(path.read_text(encoding="utf-8"))
        except ValueError as error:
            raise self._damaged(path, f"it is no JSON ({error})") from None
        new = path.with_name(path.name + ".new")
        new.unlink(missing_ok=True)
        write_json(new, said | {"job": self._name, "stored": stored(self.work.sums())})
        new.replace(path)
        shutil.rmtree(self.part / ".parts")
        if self.output.exists():
            self.output.rename(self._old)
        for name in (".lock", ".start"):
            (self.part / name).unlink(missing_ok=True)
        self.part.rename(self.output)
        if self._old.exists():
            self._remove(self._old)

    def _job(self) -> str:
        return _job_in(self.part / ".parts/job.json")

    def _begin(self, resume: bool) -> None:
        if not (resume and self._job() == self._name):
            _empty(self.part)
        if self._old.exists() and (self.output.exists() or not self._is_whole(self._old)):
            self._remove(self._old)
        elif self._old.exists():  # a run was killed while it changed the names
            self._old.rename(self.output)
            self._check_free()
        (self.part / ".parts").mkdir(exist_ok=True)
        if self._job() == self._name:
            return
        self._format.begin(self.part)
        begun = [
            str(path.relative_to(self.part))
            for path in sorted(self.part.rglob("*"))
            if path.is_file() and path.name not in (".lock", ".start")
        ]
        new = self.part / ".parts/job.json.new"
        new.unlink(missing_ok=True)
        write_json(new, {"job": self._name, "begun": file_sums(self.part, begun, False)})
        new.replace(self.part / ".parts/job.json")

    def _check_begun(self) -> None:
        """Compares the files that were there before any part with their sums."""
        job = self.part / ".parts/job.json"
        begun = json.loads(job.read_text(encoding="utf-8")).get("begun", {})
        if not isinstance(begun, dict) or not all(map(_is_entry, begun.values())):
            raise self._damaged(job, "its 'begun' is no list of files with their sums")
        self._check_foreign(begun)
        for name, (_, size, total) in begun.items():
            path = self.part / name
            ((_, found, now),) = file_sums(self.part, [name], False).values() or ((0, 0, 0),)
            ended = name == self._format.origin and _job_in(path) == self._name
            if (found, now) != (size, total) and not ended:
                raise self._damaged(
                    path,
                    f"it has {found} bytes with the checksum {now:08x}; expected {size} with "
                    f"{total:08x}",
                )

    def _check_foreign(self, begun: Collection[str]) -> None:
        """Files of the numbers which this export did not write; a reader would take them for parts.
        What a killed run was writing is removed."""
        known = {*begun, *self._format.common}
        for part in range(len(self._format.parts)):
            known.update(self._format.files(part))
        for path in (p for top in ("data", "hdf5") for p in sorted((self.part / top).rglob("*"))):
            if path.is_dir() or path.name[0] == "." or str(path.relative_to(self.part)) in known:
                continue
            if path.suffix != ".partial":  # zarr's
                raise _core.InputError(
                    f"'{path}' is not a file of this export; remove it and resume again"
                )
            path.unlink()

    def _damaged(self, path: Path, why: str) -> _core.IoError:
        return _core.IoError(
            f"'{path}' is damaged: {why}; remove {self.part} and export the data set again"
        )

    def _put_back(self) -> None:
        if self._old.exists() and not self.output.exists():
            self._old.rename(self.output)

    def _is_whole(self, folder: Path) -> bool:
        return (folder / self._format.sign).is_file()

    def _remove(self, folder: Path) -> None:
        """Removes a data set so that what a killed process leaves of it is none."""
        (folder / self._format.sign).unlink(missing_ok=True)
        shutil.rmtree(folder)

    def _check_part(self) -> None:
        """A run that was killed leaves one of these; the last two between two names."""
        signs = (".lock", ".parts", self._format.sign, self._format.origin)
        if not self.part.is_dir() or not any(self.part.iterdir()):
            return
        if not any((self.part / name).exists() for name in signs):
            raise _core.InputError(
                f"{self.part} exists and is no unfinished export; expected another name, or remove "
                "it"
            )

    def _check_free(self) -> None:
        if self.output.exists() or self.output.is_symlink():
            if not self._overwrite:
                raise _core.IoError(
                    f"{self.output} exists already; expected a new folder, or --overwrite"
                )
            if not self._is_whole(self.output):
                raise _core.InputError(
                    f"{self.output} is no {self._format.kind}; it is not overwritten"
                )


def _is_entry(value: Any) -> bool:
    """Whether it is what `file_sums` has of a file."""
    return isinstance(value, list) and [type(number) for number in value] == [int] * 3


def _job_in(path: Path) -> str:
    """The job that a file names; none if the file is missing or damaged."""
    try:
        return str(json.loads(path.read_text(encoding="utf-8"))["job"])
    except (OSError, ValueError, KeyError, TypeError):
        return ""


def named(error: OSError, path: Path) -> OSError:
    """The error with a path, if it names none: writing to a full disk does not say where."""
    if isinstance(error, _core.IoError) or error.filename or str(path) in str(error):
        return error
    if error.errno is None:
        return OSError(f"{error}: '{path}'")
    return OSError(error.errno, error.strerror, str(path))


def _locked(file: Any, how: int) -> bool:
    try:
        fcntl.flock(file, how | fcntl.LOCK_NB)
    except BlockingIOError:
        return False
    return True


def _empty(folder: Path) -> None:
    for path in folder.iterdir():
        if path.is_dir():
            shutil.rmtree(path)
        elif path.name not in (".lock", ".start"):
            path.unlink()


def write_json(path: Path, value: Any) -> None:
    """Writes a new file, in UTF-8."""
    write_text(path, json.dumps(value, indent=4, ensure_ascii=False, allow_nan=False) + "\n")


def write_text(path: Path, text: str) -> None:
    """Writes a new file, in UTF-8, to the disk."""
    with open(path, "x", encoding="utf-8") as file:
        file.write(text)
        sync(file)


def sync(file: Any) -> None:
    """Brings an open file to the disk."""
    file.flush()
    os.fsync(file.fileno())
