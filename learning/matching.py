# SPDX-License-Identifier: Apache-2.0
"""What the derivatives stored beside the rows are worth to one who learns a model of the dynamics.

    build/release/tangere generate box_pushing -o out/derived --episodes 150 --seed 1 --noise 0.3 \\
        --gradients jacobians
    python learning/matching.py out/derived --match 1

A network f maps the state x = (q, v) and the action a to the change of the state that an action
makes. With all numbers divided by their standard deviations, it minimises

    |f(z) - Δx|² + m |∂f/∂z r - J r|²,   z = (x, a),  r random with E r rᵀ = 1,

where J is what the data set has as grad_state_by_state - 1 and grad_state_by_action. m is
`--match`; 0 leaves the derivatives out. Contacts have kinks, where J jumps, so the entries of J are
bounded. It is trained with 1, 2, … episodes of mask/train, and tested on the episodes of
mask/valid: the root mean square error of Δx, in standard deviations of Δx.
"""

from __future__ import annotations

import argparse
import json
import time

import numpy as np
import torch
from protocol import provenance, source
from torch import nn

from tangere.data import Episodes

LARGEST = 5.0  # of an entry of J, in standard deviations of Δx by those of z


class Model(nn.Module):
    """z (n, inputs) → Δx (n, outputs), and along r (n, inputs) the derivative of it."""

    def __init__(self, inputs: int, outputs: int, width: int = 256):
        super().__init__()
        sizes = (inputs, width, width, outputs)
        self.layers = nn.ModuleList(nn.Linear(a, b) for a, b in zip(sizes, sizes[1:]))

    def forward(self, z: torch.Tensor, r: torch.Tensor) -> tuple[torch.Tensor, torch.Tensor]:
        for k, layer in enumerate(self.layers):
            if k:
                slope = torch.sigmoid(z)  # of softplus
                z, r = nn.functional.softplus(z), slope * r
            z, r = layer(z), nn.functional.linear(r, layer.weight)
        return z, r


def rows_of(episodes: Episodes, chosen: list[int]) -> dict[str, np.ndarray]:
    """z (n, 2 nv + na), change (n, 2 nv) and slope (n, 2 nv, 2 nv + na) of all rows of episodes."""
    parts: dict[str, list[np.ndarray]] = {"z": [], "change": [], "slope": []}
    for index in chosen:
        rows, last = episodes[index], episodes.final(index)
        state = np.concatenate([rows["q"], rows["v"]], axis=1).astype(float)
        end = np.concatenate([last["q"], last["v"]], axis=1).astype(float)
        by_state = rows["grad_state_by_state"]
        if state.shape[1] != by_state.shape[1]:
            raise SystemExit(f"{episodes.path}: q has quaternions; expected as many q as v")
        parts["z"].append(np.concatenate([state, rows["actions"]], axis=1))
        parts["change"].append(np.diff(np.concatenate([state, end]), axis=0))
        moved = by_state - np.eye(state.shape[1])
        parts["slope"].append(np.concatenate([moved, rows["grad_state_by_action"]], axis=2))
    return {name: np.concatenate(values) for name, values in parts.items()}


def fit(
    rows: dict[str, torch.Tensor], match: float, updates: int, batch: int, draw: np.random.Generator
) -> Model:
    model = Model(rows["z"].shape[1], rows["change"].shape[1])
    optimiser = torch.optim.Adam(model.parameters(), lr=1e-3)
    schedule = torch.optim.lr_scheduler.CosineAnnealingLR(optimiser, updates)
    for _ in range(updates):
        chosen = torch.from_numpy(draw.integers(len(rows["z"]), size=batch))
        z, change, slope = (rows[name][chosen] for name in ("z", "change", "slope"))
        r = torch.from_numpy(draw.standard_normal(z.shape)).float()
        found, along = model(z, r)
        loss = (found - change).square().mean()
        if match > 0:
            wanted = torch.bmm(slope, r[:, :, None])[:, :, 0]
            loss = loss + match * (along - wanted).square().mean()
        optimiser.zero_grad()
        loss.backward()
        optimiser.step()
        schedule.step()
    return model


def settings() -> argparse.Namespace:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("data", help="a folder of tangere generate --gradients jacobians")
    parser.add_argument("--match", type=float, default=0.0, help="weight of the derivatives")
    parser.add_argument("--sizes", type=int, nargs="+", default=[1, 2, 5, 10, 25, 100])
    parser.add_argument("--updates", type=int, default=2000)
    parser.add_argument("--batch", type=int, default=256)
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--json", action="store_true")
    return parser.parse_args()


def main() -> None:
    args = settings()
    torch.set_num_threads(1)
    torch.manual_seed(args.seed)
    draw = np.random.default_rng(args.seed)

    episodes = Episodes(args.data)
    train, valid = episodes.mask("train"), episodes.mask("valid")
    if max(args.sizes) > len(train):
        raise SystemExit(f"--sizes {args.sizes}; there are {len(train)} episodes to learn from")
    begin, clock = time.process_time(), time.perf_counter()
    test = rows_of(episodes, valid)
    order = draw.permutation(train)
    everything = rows_of(episodes, list(order[: max(args.sizes)]))
    counts = np.cumsum(episodes.lengths[order])
    mean, unit = everything["z"].mean(0), everything["z"].std(0) + 1e-9
    size = everything["change"].std(0) + 1e-12

    def scaled(rows: dict[str, np.ndarray]) -> dict[str, torch.Tensor]:
        slope = (rows["slope"] * unit / size[:, None]).clip(-LARGEST, LARGEST)
        values = {"z": (rows["z"] - mean) / unit, "change": rows["change"] / size, "slope": slope}
        return {name: torch.from_numpy(value).float() for name, value in values.items()}

    known, unseen, curve = scaled(everything), scaled(test), []
    for number in args.sizes:
        rows = {name: value[: counts[number - 1]] for name, value in known.items()}
        model = fit(rows, args.match, args.updates, args.batch, draw)
        with torch.no_grad():
            found, _ = model(unseen["z"], torch.zeros_like(unseen["z"]))
        error = float((found - unseen["change"]).square().mean().sqrt())
        curve.append([number, error])
        if not args.json:
            print(f"{number} episodes: error {error:.4f}", flush=True)
    cost = {"train_cpu_s": time.process_time() - begin,
            "train_wall_s": time.perf_counter() - clock}  # fmt: skip
    if args.json:
        print(json.dumps({"program": "matching", "settings": vars(args), **provenance(), **cost,
                          "data": source(episodes.masks), "curve": curve}))  # fmt: skip
        return
    print(f"{cost['train_cpu_s']:.0f} CPU s")


if __name__ == "__main__":
    main()
