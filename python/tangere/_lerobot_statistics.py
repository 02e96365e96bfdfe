# SPDX-License-Identifier: Apache-2.0
"""Statistics of features, per place on the last axis: of each episode, and of all frames.

Those of all frames come from those of the episodes, n numbers with mean m and sum of squared
deviations s each:

    N = sum n,   M = sum n m / N,   S = sum (s + n (m - M)^2)

Quantiles interpolate between neighbours in order. Most numbers of touch are 0, so only the others
are put in order.
"""

from __future__ import annotations

from typing import Any, Sequence

import numpy as np

from ._lerobot_features import Feature

SAMPLE = 4_000_000  # numbers of a feature that its quantiles are taken from
QUANTILES = {"q01": 0.01, "q10": 0.1, "q50": 0.5, "q90": 0.9, "q99": 0.99}
_MOMENTS = ("min", "max", "mean", "square")
_FEW = 4096  # numbers that are put in order as they are


def moments(rows: np.ndarray) -> dict[str, np.ndarray]:
    """Of frames (n, *shape): min, max, mean, square and quantiles, (w) each, as float64.

    square: the sum of squared deviations from the mean.
    """
    width = rows.shape[-1]
    if rows.dtype == np.uint8:
        return _of_bytes(rows.reshape(-1, width))
    flat = np.ascontiguousarray(rows).reshape(len(rows), -1)
    inner = flat.shape[1] // width
    count = len(flat) * inner
    wide = flat.astype(np.float64)
    mean = wide.sum(0).reshape(inner, width).sum(0) / count
    wide -= np.tile(mean, inner)
    square = np.einsum("ij,ij->j", wide, wide).reshape(inner, width).sum(0)
    low, high = flat.min(0).reshape(inner, width).min(0), flat.max(0).reshape(inner, width).max(0)
    found = {"min": low, "max": high, "mean": mean, "square": square}
    found |= dict(zip(QUANTILES, quantiles(flat.reshape(-1, width)), strict=True))
    return {name: np.asarray(values, np.float64) for name, values in found.items()}


def _of_bytes(flat: np.ndarray) -> dict[str, np.ndarray]:
    """`moments` of (n, w) uint8, by counting each value."""
    values = np.arange(256.0)
    counts = np.stack([np.bincount(column, minlength=256) for column in flat.T])  # (w, 256)
    mean = counts @ values / len(flat)
    square = (counts * (values - mean[:, None]) ** 2).sum(1)
    ends = np.cumsum(counts, axis=1)
    at = np.asarray(list(QUANTILES.values())) * (len(flat) - 1)
    low = np.floor(at)
    first, second = (
        np.stack([np.searchsorted(end, rank, "right") for end in ends], axis=1)
        for rank in (low, np.minimum(low + 1, len(flat) - 1))
    )
    found = {"min": flat.min(0), "max": flat.max(0), "mean": mean, "square": square}
    found |= dict(zip(QUANTILES, first + (at - low)[:, None] * (second - first), strict=True))
    return {name: np.asarray(numbers, np.float64) for name, numbers in found.items()}


def quantiles(flat: np.ndarray) -> np.ndarray:
    """Those of QUANTILES, of each column of (n, w): (5, w) float64."""
    at = np.asarray(list(QUANTILES.values())) * (len(flat) - 1)
    low = np.floor(at).astype(int)
    high = np.minimum(low + 1, len(flat) - 1)
    part = (at - low)[:, None]
    if flat.size <= _FEW:
        ordered = np.sort(flat, axis=0)
        first, second = ordered[low].astype(np.float64), ordered[high].astype(np.float64)
    else:
        columns = [_at_ranks(flat[:, column], low, high) for column in range(flat.shape[1])]
        first, second = np.moveaxis(np.asarray(columns, np.float64), 0, -1)
    return np.where(part < 0.5, first + part * (second - first),
                    second - (1 - part) * (second - first))  # fmt: skip


def _at_ranks(column: np.ndarray, *ranks: np.ndarray) -> list[np.ndarray]:
    """The numbers of these ranks in order, without putting zeros in order."""
    rest = column[column != 0]
    rest.sort()
    below = int(np.searchsorted(rest, 0))
    zeros = len(column) - len(rest)
    found = []
    for rank in ranks:
        place = np.where(rank < below, rank, rank - zeros)
        values = (
            rest[np.clip(place, 0, max(len(rest) - 1, 0))] if len(rest) else np.zeros(len(rank))
        )
        found.append(np.where((rank >= below) & (rank < below + zeros), 0, values))
    return found


class Statistics:
    """Those of a feature, of episodes one after the other; `frames` is the number of all frames.

    first: the number of the first frame that is added. Frames are sampled evenly for quantiles of
    all of them: every k-th, where at most SAMPLE numbers are taken.
    """

    def __init__(self, feature: Feature, frames: int, first: int = 0):
        self._feature = feature
        self._stride = max(1, -(-frames * int(np.prod(feature.shape)) // SAMPLE))
        self._next = first
        self.episodes: dict[str, list[np.ndarray]] = {name: [] for name in (*_MOMENTS, *QUANTILES)}
        self.counts: list[int] = []
        self.sample: list[np.ndarray] = []

    def add(self, rows: np.ndarray) -> None:
        """Takes the frames of an episode, (n, *shape)."""
        self.add_moments(moments(rows), len(rows))
        self.add_sample(rows)

    def add_moments(self, found: dict[str, np.ndarray], count: int) -> None:
        for name, values in found.items():
            self.episodes[name].append(values)
        self.counts.append(count)

    def add_sample(self, rows: np.ndarray) -> None:
        """Takes those of the next frames that belong to the sample; any number of episodes."""
        taken = rows[-self._next % self._stride :: self._stride]
        self.sample.append(taken.reshape(-1, rows.shape[-1]).copy())
        self._next += len(rows)

    def packed(self) -> dict[str, np.ndarray]:
        """Arrays that `joined` takes."""
        arrays = {name: np.stack(parts) for name, parts in self.episodes.items()}
        return arrays | {"counts": np.asarray(self.counts), "sample": np.concatenate(self.sample)}


def joined(packed: Sequence[dict[str, np.ndarray]]) -> dict[str, np.ndarray]:
    """Those of parts, one after the other."""
    return {name: np.concatenate([part[name] for part in packed]) for name in packed[0]}


def of_episodes(feature: Feature, packed: dict[str, np.ndarray]) -> dict[str, np.ndarray]:
    """NAME → (episodes, …), in the shape of the format: of a picture (…, 3, 1, 1), from 0 to 1."""
    inner = int(np.prod(feature.shape[:-1]))
    std = np.sqrt(packed["square"] / (packed["counts"][:, None] * inner))
    found = {name: packed[name] for name in ("min", "max", "mean")} | {"std": std}
    found |= {name: packed[name] for name in QUANTILES}
    shaped = {name: _shaped(feature, values) for name, values in found.items()}
    return shaped | {"count": packed["counts"][:, None]}


def of_all(feature: Feature, packed: dict[str, np.ndarray]) -> dict[str, Any]:
    """Those of all frames, as lists."""
    numbers = packed["counts"] * int(np.prod(feature.shape[:-1]))
    total = int(numbers.sum())
    mean = (packed["mean"] * numbers[:, None]).sum(0) / total
    square = (packed["square"] + numbers[:, None] * (packed["mean"] - mean) ** 2).sum(0)
    found = {"min": packed["min"].min(0), "max": packed["max"].max(0), "mean": mean}
    found["std"] = np.sqrt(square / total)
    found |= dict(zip(QUANTILES, quantiles(packed["sample"]), strict=True))
    shaped = {name: _shaped(feature, values[None])[0].tolist() for name, values in found.items()}
    return shaped | {"count": [int(packed["counts"].sum())]}


def _shaped(feature: Feature, values: np.ndarray) -> np.ndarray:
    return (values / 255.0).reshape(-1, values.shape[-1], 1, 1) if feature.is_picture else values
