# SPDX-License-Identifier: Apache-2.0
"""ACT of lerobot, learned from an exported data set with touch or without it, and played.

    build/release/tangere generate cap_opening -o out/caps --episodes 600 --seed 1
    python -m tangere.lerobot out/caps out/caps_lerobot --touch state --only-success --mask train
    python learning/lerobot_act.py out/caps_lerobot out/act
    python learning/lerobot_act.py out/caps_lerobot out/act_blind --blind

It needs lerobot 0.4.4. With --blind all numbers of touch are 0, in training and when played. The
network is small, so that a processor is enough: `lerobot-train` has the same network and optimiser,
and its checkpoints are played by `tangere.lerobot.play` as well.
"""

from __future__ import annotations

import argparse
import json
import sys
import time
from pathlib import Path
from typing import Any

import torch
from lerobot.configs.types import FeatureType
from lerobot.datasets.lerobot_dataset import LeRobotDataset, LeRobotDatasetMetadata
from lerobot.datasets.utils import dataset_to_policy_features
from lerobot.policies.act.configuration_act import ACTConfig
from lerobot.policies.act.modeling_act import ACTPolicy
from lerobot.policies.factory import make_pre_post_processors
from tracking import Log, add_log

import tangere.lerobot


def touch_of(data: Path) -> dict[str, Any]:
    """Feature → which of its numbers are touch: a mask, or all of a picture."""
    columns = json.loads((data / "meta/tangere.json").read_text())["columns"]
    found: dict[str, Any] = {}
    for column in columns:
        if column["dtype"] == "image":
            found[column["name"]] = ...
        elif "blocks" in column:
            keys = tuple(column["blocks"])
            found[column["name"]] = [name.startswith(keys) for name in column["names"]]
    return found


def blind(frames: dict[str, Any], touch: dict[str, Any]) -> dict[str, Any]:
    """The features without touch."""
    frames = {name: rows.clone() if torch.is_tensor(rows) else rows.copy()
              for name, rows in frames.items()}  # fmt: skip
    for name, which in touch.items():
        frames[name][..., which] = 0
    return frames


class Blind:
    """A checkpoint that is played without touch."""

    def __init__(self, policy: tangere.lerobot.Checkpoint, touch: dict[str, Any]):
        self.policy, self.touch, self.reset = policy, touch, policy.reset

    def __call__(self, frames: dict[str, Any]) -> Any:
        return self.policy(blind(frames, self.touch))


def settings() -> argparse.Namespace:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("data", type=Path, help="a folder of python -m tangere.lerobot")
    parser.add_argument("output", type=Path, help="folder of the checkpoint")
    parser.add_argument("--blind", action="store_true", help="without touch")
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--updates", type=int, default=4000)
    parser.add_argument("--batch", type=int, default=256)
    parser.add_argument("--rate", type=float, default=1e-3)
    parser.add_argument("--chunk", type=int, default=8, help="actions that are predicted")
    parser.add_argument("--width", type=int, default=128)
    parser.add_argument("--episodes", type=int, default=300, help="to play")
    parser.add_argument("--threads", type=int, default=1)
    add_log(parser)
    return parser.parse_args()


def rows_of(data: Path, chunk: int) -> dict[str, torch.Tensor]:
    """Every frame with the actions that follow, as lerobot reads them, in memory."""
    fps = LeRobotDatasetMetadata("local/data", root=data).fps
    ahead = {"action": [i / fps for i in range(chunk)]}
    loader = torch.utils.data.DataLoader(
        LeRobotDataset("local/data", root=data, delta_timestamps=ahead), batch_size=256
    )
    batches = list(loader)
    wanted = [name for name in batches[0] if name.startswith(("observation", "action"))]
    rows = {name: torch.cat([batch[name] for batch in batches]) for name in wanted}
    rows["action"] = rows["action"].reshape(len(rows["action"]), chunk, -1)  # of one number, too
    return rows


def train(args: argparse.Namespace) -> None:
    """Leaves a checkpoint in the folder `output`."""
    meta = LeRobotDatasetMetadata("local/data", root=args.data)
    features = dataset_to_policy_features(meta.features)
    config = ACTConfig(
        input_features={n: f for n, f in features.items() if f.type is not FeatureType.ACTION},
        output_features={"action": features["action"]},
        chunk_size=args.chunk, n_action_steps=1, dim_model=args.width, n_heads=4,
        dim_feedforward=2 * args.width, n_encoder_layers=2, use_vae=False, dropout=0.0,
        pretrained_backbone_weights=None, device="cpu", push_to_hub=False,
    )  # fmt: skip
    policy = ACTPolicy(config)
    before, after = make_pre_post_processors(config, dataset_stats=meta.stats)
    rows = rows_of(args.data, args.chunk)
    rows = blind(rows, touch_of(args.data)) if args.blind else rows
    optimiser = torch.optim.AdamW(policy.parameters(), lr=args.rate, weight_decay=1e-4)
    schedule = torch.optim.lr_scheduler.CosineAnnealingLR(optimiser, args.updates)
    log = Log(args.log)
    policy.train()
    for update in range(args.updates):
        which = torch.randint(len(rows["action"]), (args.batch,))
        loss, _ = policy(before({name: part[which] for name, part in rows.items()}))
        optimiser.zero_grad()
        loss.backward()
        torch.nn.utils.clip_grad_norm_(policy.parameters(), 10)
        optimiser.step()
        schedule.step()
        if (update + 1) % 500 == 0:
            log(update + 1, loss=loss)
            print(f"update {update + 1}: loss {loss.item():.4f}", file=sys.stderr, flush=True)
    for part in (policy, before, after):
        part.save_pretrained(args.output)


def main() -> None:
    args = settings()
    torch.set_num_threads(args.threads)
    torch.manual_seed(args.seed)
    begin = time.process_time()
    train(args)
    cost = time.process_time() - begin
    policy: Any = tangere.lerobot.Checkpoint(args.output)
    if args.blind:
        policy = Blind(policy, touch_of(args.data))
    found = tangere.lerobot.play(policy, args.data, args.episodes, threads=args.threads)
    print(json.dumps(found | {"blind": args.blind, "train_cpu_s": cost}))


if __name__ == "__main__":
    main()
