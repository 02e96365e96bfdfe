# SPDX-License-Identifier: Apache-2.0
"""A window with pictures of environments, by pygame, which few programs need."""

from __future__ import annotations

import math
import os
from collections.abc import Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from . import _core
from ._picture import HEIGHT, WIDTH

_OTHERWISE = "or render_mode 'rgb_array'"


def _pygame() -> Any:
    os.environ.setdefault("PYGAME_HIDE_SUPPORT_PROMPT", "1")
    try:
        import pygame
    except ImportError:
        raise _core.IoError(
            "render_mode 'human' without the package pygame; expected it from "
            f"`pip install pygame`, {_OTHERWISE}"
        ) from None
    return pygame


class Window:
    """Opens with the first pictures. pygame has one window in a process. `rate`: pictures a second
    at most [1/s]. Raises IoError without pygame."""

    def __init__(self, rate: float) -> None:
        self._game, self._rate = _pygame(), rate
        self._clock, self._shown = self._game.time.Clock(), False

    def show(self, pictures: Sequence[NDArray[np.uint8]]) -> None:
        """Shows pictures (HEIGHT, WIDTH, 3) in rows, smaller where there are more than two in a
        row. Raises IoError where no window can be opened."""
        columns = math.ceil(math.sqrt(len(pictures)))
        width, height = (size * min(2, columns) // columns for size in (WIDTH, HEIGHT))
        screen = self._screen((columns * width, math.ceil(len(pictures) / columns) * height))
        for k, picture in enumerate(pictures):
            whole = self._game.image.frombuffer(picture.tobytes(), (WIDTH, HEIGHT), "RGB")
            part = self._game.transform.smoothscale(whole, (width, height))
            screen.blit(part, (k % columns * width, k // columns * height))
        self._shown = True
        self._game.event.pump()
        self._clock.tick(self._rate)
        self._game.display.flip()

    def close(self) -> None:
        """Closes it, if it is open and was used."""
        if self._shown:
            self._game.display.quit()

    def _screen(self, size: tuple[int, int]) -> Any:
        """The window of that size [pixels]; opens it, or another one in its place."""
        display = self._game.display
        if display.get_init() and (screen := display.get_surface()) is not None:
            if screen.get_size() == size:
                return screen
        reason = "SDL found no display"
        try:
            display.init()
            # Without a display SDL draws where nobody sees it.
            if display.get_driver() != "offscreen" or "SDL_VIDEODRIVER" in os.environ:
                screen = display.set_mode(size)
                display.set_caption("tangere")
                return screen
            display.quit()
        except self._game.error as error:
            reason = str(error)
        raise _core.IoError(
            f"render_mode 'human': {reason}; expected one in DISPLAY or WAYLAND_DISPLAY, "
            f"{_OTHERWISE}"
        )
