# SPDX-License-Identifier: Apache-2.0
"""Rollouts of a scene from given states with given controls, in one call."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np

from . import _core


def rollout(
    model: _core.Model | _core.Scene | str | Path,
    q: Any,
    v: Any,
    controls: Any,
    *,
    read: Sequence[str] = (),
    every: int = 1,
    threads: int | None = None,
    precision: str = "mixed",
) -> _core.Run:
    """Takes steps from the states q (E, nq) and v (E, nv) with the controls (T, E, nu).

        run = tangere.rollout(model, q, v, controls, read=["pad"], every=10)
        run.q, run.v, run.fields["pad"], run.status

    One row of q or v, and controls (T, nu), stand for all environments; E is the number of rows of
    whatever has several. What `<randomize>` draws is that of the first episodes of seed 0.

    Parameters
    ----------
    model: a model, a scene, or a scene's file.
    read: sensors and their sums, pressures …, as for `Batch.run`.
    every: steps between two frames of the result.
    precision: of tactile fields, "mixed" (float32) or "double".

    Raises InputError for shapes that do not fit and for numbers that are not finite.
    """
    if not isinstance(model, _core.Model):
        scene = model if isinstance(model, _core.Scene) else _core.Scene(model)
        model = _core.Model(scene)
    q, v, u = (np.asarray(x, np.float64) for x in (q, v, controls))
    given = {"q": q.ndim > 1 and len(q), "v": v.ndim > 1 and len(v)}
    given["controls"] = u.ndim > 2 and u.shape[1]
    counts = {int(count) for count in given.values() if count}
    if len(counts) > 1:
        said = ", ".join(f"{name} has {count}" for name, count in given.items() if count)
        raise _core.InputError(f"environments: {said}; expected one number of them")
    envs = counts.pop() if counts else 1
    shapes: dict[str, tuple[Any, tuple[int, ...]]] = {
        "q": (q, (envs, model.nq)),
        "v": (v, (envs, model.nv)),
        "controls": (u if u.ndim != 2 else u[:, None], (*u.shape[:1], envs, model.nu)),
    }
    full = []
    for name, (array, shape) in shapes.items():
        try:
            full.append(np.broadcast_to(array, shape))
        except ValueError:
            raise _core.InputError(
                f"{name} of shape {np.shape(array)}; expected {shape}"
            ) from None
    if not np.isfinite(u).all():
        raise _core.InputError("controls that are not finite; expected numbers")
    batch = _core.Batch(model, envs, threads=threads, precision=precision)
    batch.set_state(full[0], full[1])
    return batch.run(full[2], every=every, fields=list(read))
