# SPDX-License-Identifier: Apache-2.0
"""A policy in Python that `tangere generate --program` calls for actions.

    # my_policy.py
    import tangere.policy

    def choose(obs, episodes, actions):            # KEY → (n, …) float32; (n); (n)
        return -obs["goal"]                        # (n, na)

    tangere.policy.serve(choose, name="my-policy-1")

    tangere generate box_pushing -o out/mine --episodes 100 --program "python my_policy.py"

Standard input and output belong to the conversation; docs/policies.md has its bytes. What the
policy prints goes to standard error.
"""

from __future__ import annotations

import json
import os
import socket
import sys
from typing import Any, BinaryIO, Callable, Mapping

import numpy as np

from . import _arrays, _core

PROTOCOL = "tangere policy 1"
ADDRESS = "TANGERE_POLICY_SOCKET"  # where `tangere.data.generate` waits for the conversation

Choose = Callable[[dict[str, np.ndarray], np.ndarray, np.ndarray], Any]


def serve(
    choose: Choose,
    name: str,
    *,
    normalise: bool = True,
    begin: Callable[[Mapping[str, Any]], None] | None = None,
) -> int:
    """Answers the questions of `tangere generate` until there are no more; returns how many.

    Parameters
    ----------
    choose: `choose(obs, episodes, actions)` returns the next actions of n environments, (n, na);
        a tensor of PyTorch is taken without its gradients.
        `obs` is KEY → (n, …) float32 as environments show it. `episodes` (n) are numbers of
        episodes, `actions` (n) how many actions were taken in each so far: 0 at its start. A policy
        with memory keeps it by episode. Questions about an episode come in order, those of
        different blocks of 16 episodes in any order; n is at most 16.
    name: of the policy, 1 to 64 letters, digits, - and _. Files name it, so let it say which
        weights were used.
    normalise: observations are divided by the scales of the task, as in `tangere.make_vec`;
        otherwise they are in SI units.
    begin: is called once with what the command says of the task: "task", "seed", "horizon",
        "observations", "action".

    The data set has the same bytes on any number of threads if the actions depend on nothing but
    the questions about their own block. Raises InputError for actions of another shape.
    """
    input, output = _streams()
    with input, output:
        return converse(input, output, choose, name, normalise=normalise, begin=begin)


def converse(
    input: BinaryIO,
    output: BinaryIO,
    choose: Choose,
    name: str,
    *,
    normalise: bool = True,
    begin: Callable[[Mapping[str, Any]], None] | None = None,
) -> int:
    """The same as `serve` over two streams of bytes."""
    said = json.loads(input.readline() or b"{}")
    if not isinstance(said, dict) or said.get("protocol") != PROTOCOL:
        raise _core.InputError(
            f"a first line of {str(said)[:200]!r}; expected one with the protocol {PROTOCOL!r}, "
            "as `tangere generate --program` says it"
        )
    if begin is not None:
        begin(said)
    hello = {"protocol": PROTOCOL, "name": name, "normalise": normalise}
    output.write(json.dumps(hello).encode() + b"\n")
    output.flush()
    tensors = [(t["name"], tuple(t["shape"])) for t in said["observations"]]
    sizes = [int(np.prod(shape)) for _, shape in tensors]
    width = int(np.prod(said["action"]["shape"]))
    asked = 0
    while head := input.read(8):
        n = int(np.frombuffer(head, "<i8")[0])
        numbers = np.frombuffer(_exactly(input, 16 * n), "<i8").reshape(2, n)
        rows = np.frombuffer(_exactly(input, 4 * n * sum(sizes)), "<f4").reshape(n, -1)
        parts = np.split(rows, np.cumsum(sizes)[:-1], axis=1)
        obs = {
            key: part.reshape(n, *shape).copy()
            for (key, shape), part in zip(tensors, parts, strict=True)
        }
        chosen = choose(obs, numbers[0].copy(), numbers[1].copy())
        actions = np.asarray(_arrays.numbers(chosen), "<f8")
        if actions.shape[:1] != (n,) or actions.size != n * width:
            raise _core.InputError(f"actions of shape {actions.shape}; expected ({n}, {width})")
        output.write(np.asarray(n * width, "<i8").tobytes() + actions.tobytes())
        output.flush()
        asked += 1
    return asked


def _exactly(input: BinaryIO, count: int) -> bytes:
    """Raises EOFError if the stream ends before `count` bytes."""
    read = input.read(count)
    if len(read) < count:
        raise EOFError(f"{len(read)} bytes of a question; expected {count}")
    return read


def _streams() -> tuple[BinaryIO, BinaryIO]:
    """The conversation's own copies of input and output; both go elsewhere for everybody else."""
    sys.stdout.flush()
    input, output = os.fdopen(os.dup(0), "rb"), os.fdopen(os.dup(1), "wb")
    os.dup2(2, 1)
    with open(os.devnull) as nothing:
        os.dup2(nothing.fileno(), 0)
    return input, output


def _hand_over() -> int:
    """Gives the conversation to the process that called `tangere.data.generate`."""
    if ADDRESS not in os.environ:
        print(
            "tangere.policy: this data set was made by a function of a Python program, with "
            "tangere.data.generate; run that program again",
            file=sys.stderr,
        )
        return 2
    with socket.socket(socket.AF_UNIX) as to:
        to.connect(os.environ[ADDRESS])
        socket.send_fds(to, [b"x"], [0])
        os.close(0)
        os.close(1)
        to.recv(1)  # until it is over
    return 0


if __name__ == "__main__":
    sys.exit(_hand_over())
