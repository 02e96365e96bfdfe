# SPDX-License-Identifier: Apache-2.0
"""Clones of stable grasp that see pictures: of the gels, with and without markers, and of a camera.

    python learning/pictures.py out/pictures --see flow
    python learning/pictures.py out/pictures --see left.rgb_marker right.rgb_marker
    python learning/pictures.py out/pictures --see eye flow

The task is that of examples/stable_grasp.py, whose pads have gels with cameras, and whose hand has
a camera that sees the bar. The script plays it once and stores what all of them see. A clone
has one network whatever it sees: every kind is cut into 13 × 10 patches, which become 16 numbers
each, summed over kinds; then come two layers of 256. It learns from the episodes that succeeded and
plays 1000 fresh ones. It needs h5py.
"""

from __future__ import annotations

import argparse
import json
import sys
import time
from pathlib import Path
from typing import Any, Sequence

import numpy as np
import torch
from protocol import Played, add_choice, play, provenance, source, wilson
from torch import nn
from tracking import Log, add_log

import tangere
from tangere.data import Episodes, Windows, generate

sys.path.insert(0, str(Path(__file__).parents[1] / "examples"))
from stable_grasp import DENSITIES, LIFTED, PADS, StableGrasp  # noqa: E402

PATCHES = (13, 10)  # as many as the pads have points
FINE = 4  # pixels of a gel's picture along a point
EYE = (52, 60)  # pixels of the camera, a multiple of PATCHES
KINDS = ("rgb", "rgb_marker")
PICTURES = [f"{pad}.{kind}" for kind in KINDS for pad in PADS] + ["eye.rgb"]
SEEN = {"flow": "flow"} | {name.replace("_pad", "").replace("eye.rgb", "eye"): name
                           for name in PICTURES}  # fmt: skip


def scene() -> tangere.Scene:
    """The scene of the task with gels of 3 mm, G = 30 kPa, and a camera on the hand."""
    builder = tangere.SceneBuilder.from_file(tangere.scenes()["stable_grasp"])
    builder.randomize.clear()
    for pad in (builder.sensor.find("tactile", name=name) for name in PADS):
        pad.markers(stiffness=22.5, thickness=0.003)
        rows, cols = (FINE * points for points in PATCHES)
        pad.picture(rows=rows, cols=cols, noise=1.5, markers=(10, 13), marker_radius=4e-4)
    builder.sensor.camera(
        "eye", body="hand", pos=(0.12, 0, 0.02), look=(0, 0, -0.1), up=(0, 0, 1), fov=75,
        rows=EYE[0], cols=EYE[1], noise=1.5,
    )  # fmt: skip
    return builder.scene().vary(DENSITIES)


class GraspInSight(StableGrasp):
    """Stable grasp that shows pictures, too, taken while the bar is lifted."""

    scene = scene()
    fields = PADS + PICTURES

    def restart(self, envs: Any) -> None:
        if not hasattr(self, "shown"):
            self.shown = {name: self._batch.tactile(name) for name in PICTURES}
        super().restart(envs)

    def lifted(self, run: Any, envs: Any) -> None:
        super().lifted(run, envs)
        for name in self.shown:
            if name in self.fields:
                self.shown[name][envs] = run.fields[name][0, envs].numpy()

    def observe(self) -> dict[str, Any]:
        return super().observe() | {
            key: self.shown[name].copy() for key, name in SEEN.items() if name in self.shown
        }


def script(obs: dict[str, np.ndarray], *_: Any) -> np.ndarray:
    """The rule of the example, from what is shown."""
    up = np.array([1, -1])[:, None, None]
    fz, fy = up * obs["flow"][:, 0::2], -obs["flow"][:, 1::2]
    z = up * (np.arange(13) - 6)[:, None] * 1.5e-3
    y = np.broadcast_to((4.5 - np.arange(10)) * 1.5e-3, z.shape[:1] + (13, 10))
    moment, weight = (y * fz - z * fy).sum((1, 2, 3)), fz.mean((1, 2, 3))
    away = moment / (y**2 + z**2).sum() / np.where(weight == 0, np.inf, weight)
    return away[:, None] * 0.4545 * 0.018**2 / 0.05


class Clone(nn.Module):
    """Every kind of observation in 13 × 10 patches; the sum of 16 numbers of each; two layers."""

    def __init__(self, rows: dict[str, torch.Tensor], width: int = 256):
        """`rows`: those of the data set, (n, channels, rows, cols) each. Pictures are shown without
        their mean, and divided by how much they vary about it."""
        super().__init__()
        self.seen = list(rows)
        self.cuts = nn.ModuleList()
        self.means: dict[str, torch.Tensor] = {}
        self.scales: dict[str, torch.Tensor] = {}
        for key, given in rows.items():
            channels, *size = given.shape[1:]
            picture = key != "flow"
            self.means[key] = given.mean(0) if picture else torch.zeros(())
            self.scales[key] = (given - self.means[key]).std() if picture else torch.ones(())
            cut = tuple(n // p for n, p in zip(size, PATCHES, strict=True))
            self.cuts.append(nn.Conv2d(channels, 16, cut, stride=cut))
        self.net = nn.Sequential(
            nn.ELU(), nn.Flatten(), nn.Linear(16 * PATCHES[0] * PATCHES[1], width), nn.ELU(),
            nn.Linear(width, width), nn.ELU(), nn.Linear(width, 1), nn.Tanh(),
        )  # fmt: skip

    def forward(self, obs: dict[str, torch.Tensor]) -> torch.Tensor:
        patches = [
            cut((obs[key] - self.means[key]) / self.scales[key])
            for key, cut in zip(self.seen, self.cuts, strict=True)
        ]
        return self.net(torch.stack(patches).sum(0))


def shown(obs: dict[str, np.ndarray], seen: Sequence[str]) -> dict[str, torch.Tensor]:
    """(n, channels, rows, cols)."""
    rows = {key: torch.from_numpy(np.ascontiguousarray(obs[key])).float() for key in seen}
    return {key: r if key == "flow" else r.movedim(-1, 1) for key, r in rows.items()}


def train(windows: Windows, clone: Clone, args: argparse.Namespace) -> None:
    """Least squares to the actions of the data set."""
    optimiser = torch.optim.AdamW(clone.parameters(), lr=args.rate, weight_decay=1e-4)
    steps = args.epochs * -(-len(windows) // args.batch)
    schedule = torch.optim.lr_scheduler.CosineAnnealingLR(optimiser, steps)
    log = Log(args.log)
    for epoch in range(args.epochs):
        for rows in windows.batches(args.batch, seed=args.seed * 1000 + epoch):
            obs = shown({key: rows["obs"][key][:, 0] for key in clone.seen}, clone.seen)
            loss = (clone(obs) - torch.from_numpy(rows["actions"][:, 0])).square().mean()
            optimiser.zero_grad()
            loss.backward()
            optimiser.step()
            schedule.step()
        log(epoch + 1, loss=loss)


def tested(clone: Clone, args: argparse.Namespace) -> Played:
    """The clone in the test episodes."""
    task = GraspInSight
    task.fields = PADS + [SEEN[key] for key in clone.seen if key != "flow"]
    env = task(args.episodes, threads=args.threads, autoreset="disabled")

    def choose(_env: Any, obs: dict[str, np.ndarray], _t: int) -> np.ndarray:
        with torch.no_grad():
            return clone(shown(obs, clone.seen)).numpy()

    return play(env, args.play_seed, choose)


def settings() -> argparse.Namespace:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("data", type=Path, help="folder of the data set, made if it is missing")
    parser.add_argument("--see", nargs="+", choices=list(SEEN), default=["flow"])
    parser.add_argument("--demos", type=int, default=1000, help="episodes of a new data set")
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--epochs", type=int, default=40)
    parser.add_argument("--batch", type=int, default=256)
    parser.add_argument("--rate", type=float, default=1e-3)
    parser.add_argument("--episodes", type=int, default=1000, help="to play")
    parser.add_argument("--threads", type=int, default=None, help="of the simulation")
    parser.add_argument("--json", action="store_true")
    add_choice(parser)
    add_log(parser)
    return parser.parse_args()


def main() -> None:
    args = settings()
    torch.set_num_threads(1)
    torch.manual_seed(args.seed)
    if not (args.data / "robomimic.hdf5").exists():
        args.data.parent.mkdir(parents=True, exist_ok=True)
        generate(GraspInSight, args.data, args.demos, policy=script, seed=1, threads=args.threads,
                 options=["--overwrite"])  # fmt: skip
    begin, clock = time.process_time(), time.perf_counter()
    episodes = Episodes(args.data)
    windows = Windows(episodes, args.see, only_success=True)
    rows = windows.gather(np.arange(len(windows)))["obs"]
    clone = Clone(shown({key: rows[key][:, 0] for key in args.see}, args.see))
    train(windows, clone, args)
    cost = {"train_cpu_s": time.process_time() - begin,
            "train_wall_s": time.perf_counter() - clock}  # fmt: skip
    result = tested(clone, args).summary()
    by_script = len(episodes.succeeded()) / len(episodes)  # in those of the data set
    if args.json:
        said = vars(args) | {"data": str(args.data)}
        print(json.dumps({"program": "pictures", "settings": said, **provenance(), **cost,
                          "keys": args.see, "data": source(episodes.masks), "rows": len(windows),
                          "script": {"success": by_script}, "test": result}))  # fmt: skip
        return
    low, high = wilson(result["success"], args.episodes)
    print(f"stable grasp by {'+'.join(args.see)}, seed {args.seed}: clone {result['success']:.3f} "
          f"({low:.3f} to {high:.3f}), script {by_script:.3f}; {len(windows)} rows, "
          f"{cost['train_cpu_s']:.0f} CPU s")  # fmt: skip


if __name__ == "__main__":
    main()
