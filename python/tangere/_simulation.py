# SPDX-License-Identifier: Apache-2.0
"""Any scene as a differentiable function in PyTorch."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
import torch

from . import _core
from ._tape import SimulationBase, check_count, check_state_type, reading_of
from ._tape import shear_state_of, split_rows, state_text
from ._torch_run import Line, Run, first_derivatives, host_numbers, refuse_transforms


@dataclass(repr=False)
class State:
    """A batch of states. All tensors are differentiable by what led to them."""

    q: torch.Tensor  #: (E, nq) coordinates; quaternions w x y z
    v: torch.Tensor  #: (E, nv) velocities
    readings: dict[str, torch.Tensor]  #: name of `read` → (E, …)
    status: np.ndarray  #: (E) int8, StepStatus of the last steps
    step: int  #: calls of step() that led to it
    _token: torch.Tensor
    _run: Run
    _varying: np.ndarray  # (E, numbers) with which it was read

    def __getitem__(self, name: str) -> torch.Tensor:
        return reading_of(self.readings, name)

    def __repr__(self) -> str:
        return state_text(self)

    @property
    def bodies(self) -> torch.Tensor:
        """(E, nb, 13) x y z, quaternion w x y z, angular and linear velocity of every body. They
        are computed from q and v where they are used, unless `read` names them."""
        if "bodies" in self.readings:
            return self.readings["bodies"]
        refuse_transforms(self.q, self.v)
        return _Bodies.apply(self.q, self.v, self._run.tape, self._varying)

    @property
    def shear_state(self) -> torch.Tensor:
        """(E, points, 3) displacements of the springs of contacts with ks [m], which reset() takes.
        InputError: `read` does not name it."""
        return shear_state_of(self.readings)


class Simulation(SimulationBase):
    """A scene in E environments, recorded for the way back.

        sim = tangere.torch.Simulation("scene.xml", num_envs=64, steps=100, every=5)
        p = sim.parameters("tactile pad kn", "body ball radius")
        s = sim.reset(seed=1)
        for t in range(100):
            s = sim.step(s, controls[t], p)
            loss = loss + ((s["pad"] - wanted[t]) ** 2).sum() + s.v.square().sum()
        loss.backward()

    Gradients go to the controls, to the parameters of each step, and to `q`, `v`, `shear_state`,
    `parameters` and `points` of reset(), if they require them. Scripts should also call
    torch.set_num_threads(1).
    """

    def _begin(self, dtype: Any) -> None:
        self.dtype = torch.float64 if dtype is None else dtype
        self._line = Line(self.tape)
        self._run: Run | None = None

    def _made_anew(self) -> None:
        run, self._line.run = self._run, None
        if run is not None and (run.recorded or run.taken == 0):
            run.play_again()

    def parameters(self, *names: str) -> dict[str, torch.Tensor]:
        """Name → (E) float64: numbers of the scene, such as "contact pad ball kn" or "body ball
        density", in SI units (`units`), as the last reset() drew them or the last step() was given
        them. Without names: those of earlier calls.

        reset() and step() take them by name, with derivatives (docs/gradients.md lists which have
        some). Names that are new compile the scene again; steps since the last reset() are taken
        again. Raises InputError for a name that is unknown or has no derivative."""
        return {name: torch.from_numpy(x) for name, x in self._parameters(names).items()}

    def reset(
        self,
        seed: int = 0,
        *,
        q: torch.Tensor | None = None,
        v: torch.Tensor | None = None,
        shear_state: torch.Tensor | None = None,
        parameters: Mapping[str, Any] | None = None,
        points: Mapping[str, torch.Tensor] | None = None,
        randomized: Mapping[str, Any] | None = None,
    ) -> State:
        """Starts anew. `q` (E, nq) and `v` (E, nv) take the place of what the scene draws; one row
        stands for all environments. Quaternions of `q` have length one, and derivatives by them no
        part that changes it. `shear_state` (E, points, 3) or (points, 3): springs of contacts with
        ks, zeros without it. With these three a run goes on from a state of another one; a scheme
        of two steps begins anew.

        `parameters`: name → (E) or one for all, of parameters(), until a step() is given others.
        `randomized`: the same of any numbers that vary, without derivatives, as
        `Batch.randomized()` gives them.

        `points`: sensor → (points, 7), zeros for the points of the scene: it is added to their
        places x y z [m] in the body's frame and to their own kn, kt, mu and damping. The scene is
        compiled again where it differs from the last reset(). Under torch.no_grad() no step is
        recorded. Raises InputError for other shapes and names, for values that the scene could not
        have, and for points of a sensor with ks."""
        moved = None
        if points is not None:
            moved = torch.cat(self._point_rows(points, torch.zeros, torch.as_tensor))
        if shear_state is not None:
            shear_state = torch.as_tensor(shear_state)
            shear_state = shear_state.expand(self.num_envs, *shear_state.shape[-2:])
        self._check_parameters(parameters)
        named = self._named(parameters)
        states = [None if x is None else self._rows(x) for x in (q, v)]
        given = [*states, shear_state, moved, *named.values()]
        refuse_transforms(*given)
        numbers = self._rows_of(randomized, lambda x: np.array(x, float), self._filled)
        numbers |= {name: host_numbers(x) for name, x in named.items()}
        start = [host_numbers(x) for x in given[:4]]
        recorded = torch.is_grad_enabled()
        self._run = Run(self._line, seed, *start, numbers or None, recorded, recorded=recorded)
        rows, token = _Start.apply(self._run, self.dtype, tuple(named), *given)
        return self._state(rows, token, self.tape.varying())

    def step(
        self,
        state: State,
        controls: torch.Tensor,
        parameters: Mapping[str, Any] | None = None,
    ) -> State:
        """Takes `every` steps with the controls (E, nu), (nu) for all environments, or
        (every, E, nu) where each step has its own. `state` is the one that the last call returned:
        a tape has one line of steps. `parameters`: name → (E) or one for all, of parameters(), in
        these steps, in what is read after them, and in later ones until others are given. Raises
        InputError for another state or shape, for controls that are not finite, for numbers that
        the scene could not have, and under torch.no_grad() after recorded steps."""
        check_state_type(state, State)
        run = state._run
        if run is not self._run or run.taken != state.step:
            taken = 0 if self._run is None else self._run.taken
            raise _core.InputError(
                f"a state after {state.step} calls of step(), and {taken} were taken since the "
                "last reset() of this simulation; expected its last state"
            )
        check_count(run.taken, self.steps)
        if not run.current:
            raise _core.InputError(
                "step() of a run that the tape does not hold any more, since parameters(), a "
                "reset() that failed or a backward() through another run; call reset()"
            )
        if state._token.requires_grad and not torch.is_grad_enabled():
            raise _core.InputError(
                "step() under no_grad() after steps that are recorded; call reset()"
            )
        self._check_parameters(parameters)
        named = self._named(parameters)
        refuse_transforms(controls, *named.values())
        controls = self._controls(torch.as_tensor(controls))
        if not run.recorded and torch.is_grad_enabled():
            for name, x in {"controls": controls, **named}.items():
                if x.requires_grad:
                    raise _core.InputError(
                        f"{name} with a gradient after a reset() under no_grad(), which records "
                        "nothing"
                    )
        rows, token = _Step.apply(
            run, self.dtype, tuple(named), controls, state._token, *named.values()
        )
        return self._state(rows, token, self.tape.varying() if named else state._varying)

    def _filled(self, x: np.ndarray) -> np.ndarray:
        return np.full(self.num_envs, x)

    def _named(self, given: Mapping[str, Any] | None) -> dict[str, torch.Tensor]:
        def convert(x: Any) -> torch.Tensor:
            return x if isinstance(x, torch.Tensor) else torch.as_tensor(x, dtype=torch.float64)

        return self._rows_of(given, convert, lambda x: x.expand(self.num_envs))

    def _rows(self, x: torch.Tensor) -> torch.Tensor:
        x = torch.as_tensor(x)
        return x.expand(self.num_envs, -1) if x.ndim == 1 or (x.ndim == 2 and len(x) == 1) else x

    def _controls(self, x: torch.Tensor) -> torch.Tensor:
        """(E, every, nu) of controls for all environments or steps."""
        shape = (self.num_envs, self.every, self.tape.spec.action.shape[-1])
        rows = x.transpose(0, 1) if x.ndim == 3 else self._rows(x)[:, None]
        if rows.ndim != 3 or rows.shape[1] not in (1, shape[1]) or rows.shape[::2] != shape[::2]:
            envs, every, nu = shape
            raise _core.InputError(
                f"controls of shape {tuple(x.shape)}; expected ({envs}, {nu}) or "
                f"({every}, {envs}, {nu})"
            )
        return rows.expand(shape)

    def _state(self, rows: torch.Tensor, token: torch.Tensor, varying: np.ndarray) -> State:
        parts = split_rows(rows, self._observations)
        q, v = parts.pop("state.q"), parts.pop("state.v")
        assert self._run is not None
        status = self.tape.status()
        return State(q, v, parts, status, self._run.taken, token, self._run, varying)


def _tensors(bars: Any, kinds: Any) -> list[torch.Tensor | None]:
    """Derivatives as tensors of the types of what they are by; None where there was none."""
    return [None if k is None else torch.from_numpy(bar).to(k) for k, bar in zip(kinds, bars)]


class _Start(torch.autograd.Function):  # type: ignore[misc]
    """The start of a run, whose token passes from step to step."""

    @staticmethod
    def forward(ctx: Any, run: Any, dtype: Any, names: Any, *given: Any) -> Any:
        ctx.run, ctx.names = run, names
        ctx.kinds = [None if x is None else x.dtype for x in given]
        rows = torch.from_numpy(run.observations()).to(dtype)
        return rows, torch.zeros((), dtype=torch.float64)

    @staticmethod
    @first_derivatives
    def backward(ctx: Any, rows_bar: Any, token_bar: Any) -> Any:
        *bars, numbers_bar = ctx.run.reverse_start(host_numbers(rows_bar))
        bars += ctx.run.columns(numbers_bar, ctx.names)
        return (None, None, None, *_tensors(bars, ctx.kinds))


class _Step(torch.autograd.Function):  # type: ignore[misc]
    """One call of step()."""

    @staticmethod
    def forward(
        ctx: Any, run: Any, dtype: Any, names: Any, controls: Any, token: Any, *given: Any
    ) -> Any:
        ctx.run, ctx.names, ctx.step = run, names, run.taken
        ctx.kinds = [x.dtype for x in (controls, *given)]
        numbers = {name: host_numbers(x) for name, x in zip(names, given)}
        run.step(host_numbers(controls), numbers or None)
        ctx.save_for_backward(token)  # PyTorch frees it after a backward() that keeps no graph
        return torch.from_numpy(run.observations()).to(dtype), token.clone()

    @staticmethod
    @first_derivatives
    def backward(ctx: Any, rows_bar: Any, token_bar: Any) -> Any:
        try:
            _ = ctx.saved_tensors
        except RuntimeError:
            raise _core.InputError(
                "a second backward() through the same steps; give the first one retain_graph=True"
            ) from None
        control_bar, numbers_bar = ctx.run.reverse(ctx.step, host_numbers(rows_bar))
        bars = [control_bar, *ctx.run.columns(numbers_bar, ctx.names)]
        by_controls, *by_numbers = _tensors(bars, ctx.kinds)
        return (None, None, None, by_controls, token_bar, *by_numbers)


class _Bodies(torch.autograd.Function):  # type: ignore[misc]
    """Poses and twists of bodies as a function of q and v."""

    @staticmethod
    def forward(ctx: Any, q: Any, v: Any, tape: Any, varying: Any) -> Any:
        ctx.save_for_backward(q, v)
        ctx.tape, ctx.varying = tape, varying
        return torch.from_numpy(tape.bodies(host_numbers(q), host_numbers(v), varying)).to(q.dtype)

    @staticmethod
    @first_derivatives
    def backward(ctx: Any, bar: Any) -> Any:
        q, v = ctx.saved_tensors
        numbers = [host_numbers(x) for x in (q, v)]
        bars = ctx.tape.reverse_bodies(*numbers, ctx.varying, host_numbers(bar))
        return (*_tensors(bars, (q.dtype, v.dtype)), None, None)
