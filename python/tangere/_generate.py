# SPDX-License-Identifier: Apache-2.0
"""`tangere.data.generate`: the command from Python, with a function of this process as the policy.

The command starts `python -m tangere.policy`, which hands its standard input, a socket, over to
this process and waits until the conversation is over. So the function runs here, where its network
and its data are.
"""

from __future__ import annotations

import ctypes
import json
import os
import shutil
import signal
import socket
import subprocess
import sys
import tempfile
from pathlib import Path
from typing import Any, Sequence

import gymnasium

from . import _core, _scene_data, policy as policies
from .scene_env import VectorSceneEnv, registered_task

_PROGRAM = '"$TANGERE_PYTHON" -m tangere.policy'  # the same text, so the same bytes of a data set


def command_path() -> Path:
    """The command `tangere` of this installation or build. Raises IoError if there is none."""
    places = [os.environ.get("TANGERE_PROGRAM"), *_beside_package(), shutil.which("tangere")]
    for place in places:
        if place and os.access(place, os.X_OK) and not Path(place).is_dir():
            return Path(place)
    raise _core.IoError(
        "the command tangere is not on PATH; expected it there, or TANGERE_PROGRAM to name it"
    )


def _beside_package() -> list[Path]:
    """Where a wheel and a build have the command."""
    import tangere

    package = Path(tangere.__path__[0])
    return [package / "bin" / "tangere", package.parents[1] / "tangere"]


def generate(
    what: str | Path | type[VectorSceneEnv],
    output: str | Path,
    episodes: int,
    *,
    policy: policies.Choose | str | None = None,
    name: str | None = None,
    normalise: bool = True,
    seed: int = 0,
    threads: int | None = None,
    num_envs: int | None = None,
    options: tuple[str, ...] | list[str] = (),
) -> dict[str, Any]:
    """Makes a data set as `tangere generate` does, and returns what it says with --json.

    Parameters
    ----------
    what: a task's name, the path of a scene, a class of `tangere.VectorSceneEnv`, or the id
        under which a task is registered with Gymnasium.
    output: folder of the data set.
    policy: a name, such as "random", or for a task a function as `tangere.policy.serve` takes.
        None: the script of the task, the controls of a scene. A class has "random" or a function,
        which is called with all environments that play at once.
    name: of the function, for the files. None: its `__name__`.
    normalise: of the function's observations; a class has no scales.
    num_envs: environments of a class that play at once; they change no byte. None: 128.
    options: more words of the command, such as ("--compress", "deflate", "--overwrite"). A class
        has those of storage: --overwrite, --resume, --compress, --pictures, --tactile, --name and
        --shards.

    Raises InputError and IoError as the command does, with its message, and passes on what the
    function raises. In both cases no half-written file has its final name.
    """
    if callable(policy) and name is None:
        name = getattr(policy, "__name__", "<lambda>")
        if name == "<lambda>":
            raise _core.InputError("a function as policy without a name; expected `name`")
    if isinstance(options, str):
        raise _core.InputError(f"options {options!r}; expected a list, such as [{options!r}]")
    registered: str | None = None
    arguments: dict[str, Any] = {}
    if isinstance(what, str) and what in gymnasium.registry and not Path(what).exists():
        registered = what
        what, arguments = registered_task(what)
    if isinstance(what, type):
        return _of_class(what, output, episodes, options, policy=policy, name=name, seed=seed,
                         threads=threads, num_envs=num_envs, arguments=arguments,
                         registered=registered)  # fmt: skip
    if arguments:
        raise _core.InputError(
            f"{registered!r} is registered with {arguments}, which the command does not take"
        )
    if num_envs is not None:
        raise _core.InputError(
            f"num_envs {num_envs} with {str(what)!r}; expected a class of tangere.VectorSceneEnv, "
            "or threads"
        )
    words = ["generate", str(what), "--output", str(output)]
    words += ["--episodes", str(episodes), "--seed", str(seed), "--quiet", *options]
    if threads is not None:
        words += ["--threads", str(threads)]
    if not callable(policy):
        words += ["--policy", policy] if policy is not None else []
        return run_command(words)
    assert name is not None
    with tempfile.TemporaryDirectory() as folder, socket.socket(socket.AF_UNIX) as listener:
        address = str(Path(folder) / "policy")
        listener.bind(address)
        listener.listen(1)
        listener.settimeout(0.1)
        environment = os.environ | {
            policies.ADDRESS: address,
            "TANGERE_PYTHON": sys.executable,
            "PYTHONPATH": os.pathsep.join(path for path in sys.path if path),
        }
        with (
            tempfile.TemporaryFile("w+") as out,
            tempfile.TemporaryFile("w+") as err,
            subprocess.Popen(
                [str(command_path()), *words, "--json", "--program", _PROGRAM],
                stdin=subprocess.DEVNULL, stdout=out, stderr=err, env=environment,
            ) as process,
        ):  # fmt: skip
            try:
                _converse(listener, process, policy, name, normalise)
            except BaseException:
                process.terminate()
                raise
            process.wait()
            out.seek(0), err.seek(0)
            return _result(process.returncode, out.read(), err.read())


def _of_class(
    task: type, output: str | Path, episodes: int, options: Sequence[str], *, num_envs: int | None,
    **arguments: Any,
) -> dict[str, Any]:  # fmt: skip
    if not issubclass(task, VectorSceneEnv):
        raise _core.InputError(f"{task.__name__}; expected a subclass of tangere.VectorSceneEnv")
    envs = 128 if num_envs is None else num_envs
    return _scene_data.generate(
        task, output, episodes, num_envs=envs, options=options, **arguments
    )


def _converse(
    listener: socket.socket, process: subprocess.Popen, choose: policies.Choose, name: str,
    normalise: bool,
) -> None:  # fmt: skip
    """Answers the command until it has no more questions. Returns at once if it ends before."""
    failed = False

    def answer(*question: Any) -> Any:
        nonlocal failed
        try:
            return choose(*question)
        except BaseException:
            failed = True
            raise

    while True:
        try:
            helper, _ = listener.accept()
            break
        except TimeoutError:
            if process.poll() is not None:
                return
    with helper:
        _, descriptors, _, _ = socket.recv_fds(helper, 1, 1)
        with socket.socket(fileno=descriptors[0]) as conversation:
            with conversation.makefile("rb") as input, conversation.makefile("wb") as output:
                try:
                    policies.converse(input, output, answer, name, normalise=normalise)
                except (BrokenPipeError, ConnectionResetError):
                    if failed:  # the policy's own
                        raise
                    # Else the command has stopped, and says why.


def run_command(
    words: Sequence[str], dies_along: bool = False, folder: Path | None = None
) -> dict[str, Any]:
    """Runs the command and returns what it says with --json. Raises InputError and IoError as the
    command does, with its message. dies_along: it is killed if this thread of the caller is.
    folder: in which it runs; None: that of the caller."""
    run = subprocess.run(
        [str(command_path().absolute()), *words, "--json"],
        stdin=subprocess.DEVNULL, capture_output=True, text=True, cwd=folder,
        preexec_fn=_die_with_parent if dies_along else None,
    )  # fmt: skip
    return _result(run.returncode, run.stdout, run.stderr, words[0])


def _die_with_parent() -> None:
    """In a child, before its program starts: Linux kills it when its parent's thread ends."""
    ctypes.CDLL(None).prctl(1, int(signal.SIGKILL))  # PR_SET_PDEATHSIG


def _result(code: int, out: str, err: str, command: str = "generate") -> dict[str, Any]:
    try:
        said = json.loads(out)
    except ValueError:
        raise _core.IoError(f"tangere {command} ended with code {code}: {err.strip()}") from None
    if "error" in said:
        raise (_core.InputError if code == 2 else _core.IoError)(said["error"])
    return dict(said)
