# SPDX-License-Identifier: Apache-2.0
"""Pictures of environments, drawn with NumPy: bodies as flat faces, without perspective.

The nearest face of a pixel is found by depth, at twice the width and height; four such pixels are
averaged. The direction of view is that of `tangere plot SCENE`.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from . import _core

WIDTH, HEIGHT = 512, 384
_FINE = 2  # pixels along each side of one of the picture
_TURN, _LIFT = np.radians(30), np.radians(25)
_RIGHT = np.array([np.cos(_TURN), np.sin(_TURN), 0])
_UP = np.array([-np.sin(_LIFT) * np.sin(_TURN), np.sin(_LIFT) * np.cos(_TURN), np.cos(_LIFT)])
_NEAR = np.cross(_RIGHT, _UP)
_EYE = np.stack([_RIGHT, _UP, _NEAR])
_LIGHT = np.array([0.35, -0.6, 0.75]) / np.linalg.norm([0.35, -0.6, 0.75])
_PAPER, _TONES = 250, (238, 220)  # behind everything; tiles of the ground
_MARGIN = 1.3  # width of the picture by the width of the bodies
_TILES = 5  # of the ground, along the longer side of the bodies
_MOST = 2_000_000  # pairs of a face and a pixel that are in memory at once

Numbers = NDArray[np.float64]


def _rotations(quaternions: Numbers) -> Numbers:
    """(n, 3, 3) of unit quaternions (n, 4), w x y z."""
    w, x, y, z = quaternions.T
    rows = [
        [1 - 2 * (y * y + z * z), 2 * (x * y - w * z), 2 * (x * z + w * y)],
        [2 * (x * y + w * z), 1 - 2 * (x * x + z * z), 2 * (y * z - w * x)],
        [2 * (x * z - w * y), 2 * (y * z + w * x), 1 - 2 * (x * x + y * y)],
    ]
    return np.moveaxis(np.array(rows), 2, 0)


def _areas(corners: Numbers) -> Numbers:
    """(T, 3): the normals of triangles, as long as twice their areas."""
    return np.asarray(np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]))


def _posed(corners: Numbers, body: NDArray[np.int32], poses: Numbers) -> Numbers:
    """Corners (T, 3, 3) of bodies (T) in the world's frame; poses (nb, 7)."""
    turned = np.einsum("tij,tkj->tki", _rotations(poses[:, 3:])[body], corners)
    return np.asarray(turned + poses[body, None, :3])


def _fill(image: NDArray[np.float32], depth: Numbers, places: Numbers, colours: Numbers) -> None:
    """Draws triangles, `places` (T, 3, 3): right and down in pixels, and nearness in metres."""
    height, width = depth.shape
    (a, b, c) = (places[:, k] for k in range(3))
    u, v = b - a, c - a
    area = u[:, 0] * v[:, 1] - u[:, 1] * v[:, 0]
    low = np.clip(np.ceil(places[..., :2].min(1) - 0.5), 0, [width, height]).astype(int)
    high = np.clip(np.floor(places[..., :2].max(1) - 0.5) + 1, 0, [width, height]).astype(int)
    size = np.maximum(high - low, 0)
    count = size.prod(1) * (np.abs(area) > 1e-9)
    ends = np.cumsum(count)
    first = 0
    while first < len(count):
        done = ends[first - 1] if first else 0
        last = max(int(np.searchsorted(ends, done + _MOST, "right")), first + 1)
        n = count[first:last]
        t = np.repeat(np.arange(first, last), n)
        k = np.arange(len(t)) - np.repeat(np.cumsum(n) - n, n)
        x, y = low[t, 0] + k % size[t, 0], low[t, 1] + k // size[t, 0]
        dx, dy = x + 0.5 - a[t, 0], y + 0.5 - a[t, 1]
        s = (dx * v[t, 1] - dy * v[t, 0]) / area[t]
        r = (dy * u[t, 0] - dx * u[t, 1]) / area[t]
        near = a[t, 2] + s * u[t, 2] + r * v[t, 2]
        shown = (s >= 0) & (r >= 0) & (s + r <= 1) & (near > depth[y, x])
        order = np.flatnonzero(shown)
        order = order[np.argsort(near[order], kind="stable")]  # of one pixel, the last one stays
        depth[y[order], x[order]] = near[order]
        image[y[order], x[order]] = colours[t[order]]
        first = last


class View:
    """An environment during an episode: its faces, and where they are seen from.

    The camera shows all bodies at the first picture, with a margin. Where bodies leave the picture,
    it goes back and stays there.
    """

    def __init__(
        self, env: _core.Environments | _core.Batch, e: int, poses: Numbers, episode: int
    ):
        self.episode = episode
        corners, body, rgba = env.faces(e)  # half-spaces and the ground without a size
        bounded = np.abs(_areas(corners)).max(1) > 0
        world = _posed(corners[bounded], body[bounded], poses)
        seen = np.nan_to_num((world if len(world) else poses[:, None, :3]) @ _EYE.T)
        low, high = seen[..., :2].min((0, 1)), seen[..., :2].max((0, 1))
        middle, half = (low + high) / 2, _MARGIN * np.maximum((high - low) / 2, 1e-3)
        self._low, self._high = middle - half, middle + half
        size = float(max(self._high - self._low))
        corners, body, rgba = env.faces(e, size)
        shown = (body >= 0) & (rgba[:, 3] > 0)
        self._corners, self._body, self._rgb = corners[shown], body[shown], rgba[shown, :3]
        self._bounded = bounded[shown]
        self._ground = corners[body < 0]
        self._tile = size / _TILES

    def draw(self, poses: Numbers) -> NDArray[np.uint8]:
        """(HEIGHT, WIDTH, 3) of poses (nb, 7)."""
        world = _posed(self._corners, self._body, poses)
        self._take_in(world[self._bounded])
        image = np.full((_FINE * HEIGHT, _FINE * WIDTH, 3), _PAPER, np.float32)
        depth = np.full(image.shape[:2], -np.inf)
        if len(self._ground):
            self._draw_ground(image, depth)
        normals = _areas(world)
        length = np.linalg.norm(normals, axis=1)
        seen = (normals @ _NEAR > 1e-6 * length) & np.isfinite(length)
        light = 0.72 + 0.28 * (normals[seen] @ _LIGHT) / length[seen]
        tones = np.clip(255 * self._rgb[seen] * light[:, None], 0, 255)
        _fill(image, depth, self._places(world[seen]), tones)
        fine = image.reshape(HEIGHT, _FINE, WIDTH, _FINE, 3)
        return np.round(fine.mean((1, 3))).astype(np.uint8)

    def _take_in(self, world: Numbers) -> None:
        """Moves the camera back where bodies are outside of the picture."""
        seen = (world @ _EYE.T)[..., :2].reshape(-1, 2)
        if len(seen) and np.isfinite(seen).all():
            self._low = np.minimum(self._low, seen.min(0))
            self._high = np.maximum(self._high, seen.max(0))

    def _scale(self) -> float:
        """Fine pixels of a metre."""
        return float(min(_FINE * np.array([WIDTH, HEIGHT]) / (self._high - self._low)))

    def _places(self, corners: Numbers) -> Numbers:
        """On the page: right and down in fine pixels; nearness [m]."""
        seen = corners @ _EYE.T
        page = _FINE * np.array([WIDTH, HEIGHT])
        flat = page / 2 + self._scale() * (seen[..., :2] - (self._low + self._high) / 2) * [1, -1]
        return np.concatenate([flat, seen[..., 2:]], axis=-1)

    def _draw_ground(self, image: NDArray[np.float32], depth: Numbers) -> None:
        """Tiles, unless the ground is seen from below or edge on."""
        a, b, c = self._ground[0]
        along = np.stack([(b - a), (c - b)]) / np.linalg.norm(b - a)
        normal = np.cross(*along)
        if normal @ _NEAR < 1e-3:
            return
        height, width = depth.shape
        middle, scale = (self._low + self._high) / 2, self._scale()
        x = (middle[0] + (np.arange(width) + 0.5 - width / 2) / scale)[None, :]
        y = (middle[1] - (np.arange(height) + 0.5 - height / 2) / scale)[:, None]
        depth[:] = (normal @ a - x * (normal @ _RIGHT) - y * (normal @ _UP)) / (normal @ _NEAR)
        tile = [np.floor((x * (d @ _RIGHT) + y * (d @ _UP) + depth * (d @ _NEAR)) / self._tile)
                for d in along]  # fmt: skip
        image[:] = np.where((tile[0] + tile[1]) % 2 == 0, *_TONES)[..., None]
