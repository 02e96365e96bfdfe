# SPDX-License-Identifier: Apache-2.0
"""Readings of sensors in the rows of a task in Python: those of the row, or a window of all since
the row before. Their numbers are those that `tangere generate --record` stores.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from . import _core
from ._arrays import numbers

Fault = Callable[[str, str], _core.InputError]  # of what was found, and what was expected


class RowReadings:
    """What the words `readings` of a task name: "pad.sum", or "pad/5" for a window.

    steps: K, those of an action. fault: makes an error of what was found and what was expected.
    Raises it for names that no sensor has and for steps that are no divisor of K.
    """

    def __init__(
        self, words: Sequence[str], sensors: Sequence[str], steps: int, fault: Fault
    ) -> None:
        if isinstance(words, str):
            raise fault(f"readings {words!r}", f"a list, such as [{words!r}]")
        self._steps, self._fault = steps, fault
        self.between: dict[str, int] = {}  # KEY → steps between two readings
        for word in words:
            name, slash, times = str(word).partition("/")
            if not any(name == s or name.startswith(f"{s}.") for s in sensors):
                raise fault(f"reading {name!r}", f"one of a sensor of {list(sensors)}")
            if name in self.between:
                raise fault(f"reading {name!r} twice", "it once")
            if slash and not (times.isdecimal() and 0 < int(times) < steps):
                expected = f"{name!r}, or a window of less than {steps} steps"
                raise fault(f"reading {word!r}", expected)
            self.between[name] = int(times) if slash else steps
            if steps % self.between[name]:
                raise fault(f"reading {word!r}", f"a divisor of {steps}, the steps of an action")
        self.windows = {name: n for name, n in self.between.items() if n < steps}
        self.every = math.gcd(steps, *self.windows.values())  # steps between frames of a run
        self._latest: dict[str, NDArray[Any]] = {}
        self._taken = True

    @property
    def words(self) -> list[str]:
        """The words from which the readings were made."""
        windows = self.windows
        return [f"{name}/{n}" if name in windows else name for name, n in self.between.items()]

    def start(self, batch: Any, envs: NDArray[np.int64]) -> None:
        """Fills the windows of environments that begin an episode with the reading of its start."""
        for name, n in self.windows.items():
            now = numbers(batch.tactile(name))
            if now.dtype in (np.uint8, np.int16):
                raise self._fault(f"a window of {name!r}", "one of numbers, not of a picture")
            if name not in self._latest:
                shape = (len(now), self._steps // n, *now.shape[1:])
                self._latest[name] = np.zeros(shape, np.float32)
            self._latest[name][envs] = now[envs, None]

    def run(self, batch: Any, controls: Any, envs: NDArray[np.int64]) -> None:
        """Takes the steps of an action of some environments, and what is read within it."""
        if self.windows and len(controls) != self._steps:
            raise self._fault(f"simulate() of {len(controls)} steps with windows of touch",
                              f"{self._steps}, those of an action")  # fmt: skip
        every = self.every if self.windows else len(controls)
        fields = batch.run(controls, every=every, fields=[*self.windows], envs=envs).fields
        for name, n in self.windows.items():
            due = numbers(fields[name])[n // every - 1 :: n // every]
            self._latest[name][envs] = np.swapaxes(due, 0, 1)[envs]
        self._taken = True

    def expect(self) -> None:
        """Begins an action, within which `run` is due."""
        self._taken = not self.windows

    def check(self) -> None:
        """Raises an error if nothing was read within the action."""
        if not self._taken:
            found = f"simulate() without the readings of the windows {[*self.windows]}"
            raise self._fault(found, "super().simulate(controls, envs) in it")

    def rows(self, batch: Any) -> dict[str, Any]:
        """KEY → (E, …) at the present row."""
        windows = {name: self._latest[name] for name in self.windows}
        return {
            name: windows[name] if name in windows else batch.tactile(name)
            for name in self.between
        }
