# SPDX-License-Identifier: Apache-2.0
"""Processes that do the tasks of an export: check a file of the data set, write a part.

They are new Pythons, not forks: a fork of a process with threads may hang, and a process that
`multiprocessing` starts runs the caller's program again. A process reads the pickled work and then
names of tasks from its standard input, and answers each with a line of JSON. It ends when its
standard input does, so none outlives a caller that was killed. Until then it holds the lock of the
folder, whose descriptor it inherits.
"""

from __future__ import annotations

import json
import os
import pickle
import queue
import subprocess
import sys
import threading
from typing import Any, Callable, Sequence

from . import _core

_PROGRAM = "import tangere._export_pool as pool; pool.serve()"
_ERRORS: dict[str, type[BaseException]] = {
    "InputError": _core.InputError, "IoError": _core.IoError, "OSError": OSError
}  # fmt: skip


class Pool:
    """Does tasks of `work` with `workers` processes, which inherit `lock`."""

    def __init__(self, work: Any, workers: int, lock: int):
        self._workers, self._lock = workers, lock
        self._setting = pickle.dumps(work)
        self._left: queue.SimpleQueue[str] = queue.SimpleQueue()
        self._failed: list[BaseException] = []
        self._processes: list[subprocess.Popen[bytes]] = []

    def run(self, tasks: Sequence[str], end: Callable[[str], None]) -> None:
        """Calls `end` with each task that is done, from several threads. Raises what the first
        process that failed has raised."""
        for task in tasks:
            self._left.put(task)
        threads = [threading.Thread(target=self._feed, args=(end,)) for _ in range(self._workers)]
        try:
            for thread in threads:
                thread.start()
            for thread in threads:
                while thread.is_alive():  # so that a signal is served
                    thread.join(0.1)
        except BaseException:
            self._stop()
            for thread in threads:
                thread.join()
            raise
        if self._failed:
            raise self._failed[0]

    def _feed(self, end: Callable[[str], None]) -> None:
        path = os.pathsep.join(path for path in sys.path if path)
        alone = {"PYTHONPATH": path, "OMP_NUM_THREADS": "1", "OPENBLAS_NUM_THREADS": "1"}
        try:
            process = subprocess.Popen(
                [sys.executable, "-c", _PROGRAM], env=os.environ | alone,
                stdin=subprocess.PIPE, stdout=subprocess.PIPE, start_new_session=True,
                pass_fds=(self._lock,),
            )  # fmt: skip
        except BaseException as error:
            self._fail(error)
            return
        self._processes.append(process)
        assert process.stdin and process.stdout
        task = ""
        try:
            process.stdin.write(len(self._setting).to_bytes(8, "little") + self._setting)
            while not self._failed:
                try:
                    task = self._left.get_nowait()
                except queue.Empty:
                    break
                process.stdin.write(f"{task}\n".encode())
                process.stdin.flush()
                answer = json.loads(process.stdout.readline() or b"{}")
                if answer.get("task") != task:
                    raise _error_of(answer, task, process)
                end(task)
            process.stdin.close()
        except BrokenPipeError:
            self._fail(_error_of({}, task, process))
        except BaseException as error:
            self._fail(error)
        finally:
            process.stdout.close()
            process.wait()

    def _fail(self, error: BaseException) -> None:
        self._failed.append(error)
        self._stop()

    def _stop(self) -> None:
        self._failed.append(KeyboardInterrupt())
        for process in self._processes:
            if process.poll() is None:
                process.terminate()


def _error_of(
    answer: dict[str, Any], task: str, process: subprocess.Popen[bytes]
) -> BaseException:
    if "error" in answer:
        kind = _ERRORS[answer["error"]]
        return kind(*answer["arguments"])
    return _core.IoError(
        f"the process that did part {task} of an export ended with code {process.wait()}"
    )


def serve() -> None:
    """What a process of the pool does, until its standard input ends."""
    out, sys.stdout = sys.stdout, sys.stderr  # nothing else may answer
    source = sys.stdin.buffer
    work = pickle.loads(source.read(int.from_bytes(source.read(8), "little")))
    tasks: queue.SimpleQueue[str] = queue.SimpleQueue()

    def listen() -> None:
        for line in source:
            tasks.put(line.decode().strip())
        os._exit(0)  # every task is answered, or the caller is gone

    threading.Thread(target=listen, daemon=True).start()
    while True:
        out.write(json.dumps(_answer(work, tasks.get())) + "\n")
        out.flush()


def _answer(work: Any, task: str) -> dict[str, Any]:
    try:
        work.do(task)
        return {"task": task}
    except (_core.InputError, _core.IoError) as error:
        return {"error": type(error).__name__, "arguments": [str(error)]}
    except OSError as error:
        if error.errno is None:
            return {"error": "OSError", "arguments": [str(error)]}
        named = [str(error.filename)] if error.filename else []
        return {"error": "OSError", "arguments": [error.errno, error.strerror, *named]}
