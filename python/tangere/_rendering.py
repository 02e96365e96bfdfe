# SPDX-License-Identifier: Apache-2.0
"""What `render_mode` of environments stands for: pictures as arrays, or a window with them.

Arrays are what the first camera of the scene sees; without a camera, and in the window, bodies are
drawn from the side.
"""

from __future__ import annotations

from typing import Literal

import numpy as np
from numpy.typing import NDArray

from . import _core
from ._picture import View
from ._window import Window

RenderMode = Literal["rgb_array", "human"] | None
MODES = ["rgb_array", "human"]
_SHOWN = 16  # environments in a window, at most

Pictures = tuple[NDArray[np.uint8], ...]


class Rendering:
    """Draws environments, each as it looks in its episode. `rate`: of pictures in a window
    [1/s]. Raises InputError for another mode, IoError without what a window needs."""

    def __init__(self, mode: RenderMode, rate: float) -> None:
        if mode not in (None, *MODES):
            raise _core.InputError(f"render_mode {mode!r}; expected None or one of {MODES}")
        self.mode = mode
        self._window = Window(rate) if mode == "human" else None
        self._views: dict[int, View] = {}

    def clear(self) -> None:
        """Other episodes begin, which may have the numbers of the last ones."""
        self._views.clear()

    def render(
        self, env: _core.Environments | _core.Batch, episodes: NDArray[np.int64]
    ) -> Pictures | None:
        """A picture of every environment, or None where they are shown in the window."""
        self.show(env, episodes)
        if self.mode != "rgb_array":
            return None
        if env.model.cameras:
            name = env.model.cameras[0].name
            if isinstance(env, _core.Batch):
                return tuple(env.tactile(f"{name}.rgb"))
            return tuple(env.camera(name))
        return self._draw(env, episodes, len(episodes))

    def show(self, env: _core.Environments | _core.Batch, episodes: NDArray[np.int64]) -> None:
        """Shows the environments if there is a window."""
        if self._window is not None:
            self._window.show(self._draw(env, episodes, min(len(episodes), _SHOWN)))

    def close(self) -> None:
        """Closes the window."""
        if self._window is not None:
            self._window.close()

    def _draw(
        self, env: _core.Environments | _core.Batch, episodes: NDArray[np.int64], count: int
    ) -> Pictures:
        poses = env.bodies()[0]
        for e in range(count):
            if e not in self._views or self._views[e].episode != episodes[e]:
                self._views[e] = View(env, e, poses[e], int(episodes[e]))
        return tuple(self._views[e].draw(poses[e]) for e in range(count))
