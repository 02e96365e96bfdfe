# SPDX-License-Identifier: Apache-2.0
"""Any scene as a differentiable function in PyTorch."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import torch

from . import _core
from ._tape import SimulationBase, split_rows
from ._torch_run import Line, Run


@dataclass
class State:
    """A batch of states. All tensors are differentiable by what led to them."""

    q: torch.Tensor  #: (E, nq) coordinates; quaternions w x y z
    v: torch.Tensor  #: (E, nv) velocities
    readings: dict[str, torch.Tensor]  #: name of `read` → (E, …)
    status: np.ndarray  #: (E) int8, StepStatus of the last steps
    step: int  #: calls of step() that led to it
    _token: torch.Tensor
    _run: Run

    def __getitem__(self, name: str) -> torch.Tensor:
        return self.readings[name]


class Simulation(SimulationBase):
    """A scene in E environments, recorded for the way back.

        sim = tangere.torch.Simulation("scene.xml", num_envs=64, steps=100, every=5)
        s = sim.reset(seed=1)
        for t in range(100):
            s = sim.step(s, controls[t])
            loss = loss + ((s["pad"] - wanted[t]) ** 2).sum() + s.v.square().sum()
        loss.backward()

    Gradients go to the controls, and to `q`, `v`, `parameters` and `points` of reset() if they
    require them.

    Parameters
    ----------
    scene: a file, or a `tangere.Scene`.
    num_envs: E. Environment e has draw e of a seed.
    steps: calls of step() after a reset(), at most.
    every: steps of the simulation in each, with the same controls.
    read: names of what s[name] holds, for each environment: "pad" (rows, cols, 3) [N], "pad.sum"
        (6), "pad.pressure", "pad.shear", "pad.flow", "pad.markers" of sensors; "bodies" (nb, 13) or
        "bodies.box" (13): x y z, quaternion w x y z, angular and linear velocity; "variables"
        (n, 3), the end effectors, or one by its name (3). None: end effectors and all fields.
    parameters: names of numbers of the scene, such as "contact pad ball kn" or "body ball density",
        that environments may have of their own (docs/gradients.md).
    points: whether reset() may move points of sensors.
    threads: None for all cores. Scripts should also call torch.set_num_threads(1).
    precision: of tactile fields, "double" or "mixed".
    tape_bytes: limit for the tapes [bytes]. Longer runs are played again from checkpoints.
    dtype: of states. Controls may have any floating type.
    """

    def __init__(
        self,
        scene: _core.Scene | str | Path,
        num_envs: int = 1,
        steps: int = 100,
        *,
        every: int = 1,
        read: Sequence[str] | None = None,
        parameters: Sequence[str] = (),
        points: bool = False,
        threads: int | None = None,
        precision: str = "double",
        tape_bytes: float = 1e9,
        dtype: torch.dtype = torch.float64,
    ):
        options = dict(threads=threads, precision=precision, tape_bytes=tape_bytes)
        super().__init__(scene, num_envs, steps, every, read, parameters, points=points, **options)
        self.dtype = dtype
        self._line = Line(self.tape)
        self._run: Run | None = None

    def reset(
        self,
        seed: int = 0,
        *,
        q: torch.Tensor | None = None,
        v: torch.Tensor | None = None,
        parameters: torch.Tensor | None = None,
        points: Mapping[str, torch.Tensor] | None = None,
        randomized: Mapping[str, Any] | None = None,
    ) -> State:
        """Starts anew. `q` (E, nq), `v` (E, nv) and `parameters` (E, names), in SI units, take the
        place of what the scene draws; one row stands for all environments. Quaternions of `q` have
        length one, and derivatives by them no part that changes it. `randomized`: name → value or
        (E), of numbers that vary, in place of what the scene draws and without derivatives, as
        `Batch.randomized()` gives them.

        `points`: sensor → (points, 7), zeros for the points of the scene: it is added to their
        places x y z [m] in the body's frame and to their own kn, kt, mu and damping. The scene is
        compiled again where it differs from the last reset(). Under torch.no_grad() no step is
        recorded. Raises InputError for other shapes and names, and for points of a sensor with
        ks."""
        given = [None if x is None else self._rows(x) for x in (q, v, parameters)]
        if points is not None:
            given.append(torch.cat(self._point_rows(points, torch.zeros, torch.as_tensor)))
        else:
            given.append(None)
        given_numbers, recorded = [_numpy(x) for x in given], torch.is_grad_enabled()
        drawn = None if randomized is None else dict(randomized)
        self._run = Run(self._line, seed, *given_numbers, drawn, recorded, recorded=recorded)
        rows, token = _Start.apply(*given, self._run, self.dtype)
        return self._state(rows, token)

    def step(self, state: State, controls: torch.Tensor) -> State:
        """Takes `every` steps with the controls (E, nu), or (nu) for all environments. `state` is
        the one that the last call returned: a tape has one line of steps. Raises InputError for
        another state or shape, for controls that are not finite, and under torch.no_grad() after
        recorded steps."""
        run = state._run
        if run is not self._run or run.taken != state.step:
            taken = 0 if self._run is None else self._run.taken
            raise _core.InputError(
                f"a state after {state.step} calls of step(), and {taken} were taken since the "
                "last reset() of this simulation; expected its last state"
            )
        if not run.current:
            raise _core.InputError("step() after backward() through another run; call reset()")
        if state._token.requires_grad and not torch.is_grad_enabled():
            raise _core.InputError(
                "step() under no_grad() after steps that are recorded; call reset()"
            )
        controls = self._rows(torch.as_tensor(controls))
        if controls.requires_grad and torch.is_grad_enabled() and not run.recorded:
            raise _core.InputError(
                "controls with a gradient after a reset() under no_grad(), which records nothing"
            )
        return self._state(*_Step.apply(controls, state._token, run, self.dtype))

    def parameters(self) -> torch.Tensor:
        """(E, names) of the run, in SI units: what reset() drew or was given."""
        return torch.from_numpy(self.tape.parameters())

    def _rows(self, x: torch.Tensor) -> torch.Tensor:
        x = torch.as_tensor(x)
        return x.expand(self.num_envs, -1) if x.ndim == 1 or (x.ndim == 2 and len(x) == 1) else x

    def _state(self, rows: torch.Tensor, token: torch.Tensor) -> State:
        parts = split_rows(rows, self._observations)
        q, v = parts.pop("state.q"), parts.pop("state.v")
        assert self._run is not None
        status = self.tape.status()
        return State(q, v, parts, status, self._run.taken, token, self._run)


def _numpy(x: Any) -> Any:
    return None if x is None else x.detach().to("cpu", torch.float64).numpy()


class _Start(torch.autograd.Function):  # type: ignore[misc]
    """The start of a run, whose token passes from step to step."""

    @staticmethod
    def forward(
        ctx: Any, q: Any, v: Any, parameters: Any, points: Any, run: Any, dtype: Any
    ) -> Any:
        given = (q, v, parameters, points)
        ctx.run, ctx.given = run, [None if x is None else x.dtype for x in given]
        rows = torch.from_numpy(run.observations()).to(dtype)
        return rows, torch.zeros((), dtype=torch.float64)

    @staticmethod
    @torch.autograd.function.once_differentiable  # type: ignore[untyped-decorator]
    def backward(ctx: Any, rows_bar: Any, token_bar: Any) -> Any:
        bars = ctx.run.reverse_start(rows_bar.to("cpu", torch.float64).numpy())
        out = [
            None if kind is None else torch.from_numpy(bar).to(kind)
            for kind, bar in zip(ctx.given, bars)
        ]
        return (*out, None, None)


class _Step(torch.autograd.Function):  # type: ignore[misc]
    """One call of step()."""

    @staticmethod
    def forward(ctx: Any, controls: Any, token: Any, run: Any, dtype: Any) -> Any:
        ctx.run, ctx.step, ctx.dtype = run, run.taken, controls.dtype
        run.step(_numpy(controls))
        ctx.save_for_backward(token)  # PyTorch frees it after a backward() that keeps no graph
        return torch.from_numpy(run.observations()).to(dtype), token.clone()

    @staticmethod
    @torch.autograd.function.once_differentiable  # type: ignore[untyped-decorator]
    def backward(ctx: Any, rows_bar: Any, token_bar: Any) -> Any:
        try:
            _ = ctx.saved_tensors
        except RuntimeError:
            raise _core.InputError(
                "a second backward() through the same steps; give the first one retain_graph=True"
            ) from None
        bar = ctx.run.reverse(ctx.step, rows_bar.to("cpu", torch.float64).numpy())
        return torch.from_numpy(bar).to(ctx.dtype), token_bar, None, None
