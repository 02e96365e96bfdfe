# SPDX-License-Identifier: Apache-2.0
"""Pages on which a run moves, also in a notebook."""

from __future__ import annotations

import html
from collections.abc import Sequence
from pathlib import Path

import numpy as np

from . import _core


_EXPORTS = ("meta/tangere.json", ".zattrs", "metadata.json")  # each in one of the formats


class Page:
    """A page on which a run moves (docs/view.md). A notebook shows it in a cell."""

    def __init__(self, text: str, height: int) -> None:
        self.html, self.height = text, height

    def save(self, path: str | Path) -> Path:
        """Writes the page, which needs no other file."""
        Path(path).write_text(self.html, encoding="utf-8")
        return Path(path)

    def _repr_html_(self) -> str:
        return (
            f'<iframe srcdoc="{html.escape(self.html)}" width="100%" height="{self.height}" '
            'style="border:0"></iframe>'
        )


def view(
    run: _core.Run | str | Path,
    *,
    envs: Sequence[int] | None = None,
    episodes: int = 16,
    frames: int = 1000,
    height: int = 600,
) -> Page:
    """Shows a run: what `Batch.run()` returned, a trajectory file, a data set or an export.

        run = batch.run(u, every=10, fields=["pad"])
        tangere.view(run)                      # in a notebook; or .save("run.html")

    Parameters
    ----------
    envs: environments of a run in memory; None: the first `episodes`.
    episodes: environments or episodes at most.
    frames: of each, at most; more are thinned evenly.
    height: of the cell [pixels].
    """
    if not isinstance(run, (_core.Run, str, Path)):
        raise _core.InputError(
            f"a run of type {type(run).__name__}; expected what Batch.run() returned, or a path"
        )
    if not isinstance(run, _core.Run):
        if envs is not None:
            raise _core.InputError("envs of a file; expected a run of Batch.run()")
        if any((Path(run) / name).is_file() for name in _EXPORTS):
            from . import _view_export  # h5py and the library of the format

            return Page(_view_export.page(run, episodes=episodes, frames=frames)[0], height)
        return Page(_core.view_file(run, None, episodes, frames), height)
    count = run.q.shape[1]
    chosen = list(range(min(episodes, count))) if envs is None else [int(e) for e in envs]
    if not chosen or min(chosen) < 0 or max(chosen) >= count:
        raise _core.InputError(f"envs {chosen}; expected some of 0 to {count - 1}")
    randomized = run.randomized
    values = np.array([[x[e] for x in randomized.values()] for e in chosen])
    sensors = {sensor.name: sensor.points for sensor in run.model.sensors}
    fields = {
        name: np.swapaxes(field[:, chosen], 0, 1).reshape(len(chosen), len(field), points, 3)
        for name, field in run.fields.items()
        if (points := sensors.get(name)) is not None
    }
    time = run.interval * np.arange(1, len(run.q) + 1)
    page = _core.view_run(
        run.model,
        time,
        chosen,
        list(randomized),
        values.reshape(len(chosen), len(randomized)),
        np.swapaxes(run.q[:, chosen], 0, 1),
        fields,
        frames,
    )
    return Page(page, height)
