# SPDX-License-Identifier: Apache-2.0
"""Box pushing by gradients through time: Adam on a policy, through 100 actions of simulation.

    python learning/gd.py box_pushing_privileged --seed 0

The settings are the published ones: 64–64 ELU, Adam 5e-3 → 1e-5, betas 0.7 and 0.95, gradient norm
at most 1, 16 episodes an update, 300 updates; the best policy by its mean return is kept. Prints
the errors in place [m] and yaw [rad] on 300 fresh goals.
"""

from __future__ import annotations

import argparse
import json
import time

import numpy as np
import torch
from torch import nn

import tangere
import tangere.torch

TEST_SEED = 1000003  # of the goals that policies are tested on


def small_policy(inputs: int, actions: int) -> nn.Module:
    return nn.Sequential(
        nn.Linear(inputs, 64), nn.ELU(), nn.Linear(64, 64), nn.ELU(), nn.Linear(64, actions)
    )


def act(policy: nn.Module, obs: torch.Tensor, gains: torch.Tensor) -> torch.Tensor:
    return torch.tanh(policy(obs * gains))


def touch_gains(spec: tangere.TaskSpec, gain: float) -> torch.Tensor:
    """(n): `gain` where an observation is touch, else 1."""
    parts = [
        torch.full((int(np.prod(t.shape)),), gain if t.name == "tactile" else 1.0)
        for t in spec.observations
    ]
    return torch.cat(parts)


def test(task: str, policy: nn.Module, gains: torch.Tensor, episodes: int) -> dict[str, float]:
    """Errors at the end of fresh episodes, their return, and the share of successes."""
    env = tangere.make_vec(task, episodes, seed=TEST_SEED, flatten=True, autoreset="disabled")
    obs, _ = env.reset()
    returns = np.zeros(episodes)
    for _ in range(env.task.horizon):
        with torch.no_grad():
            action = act(policy, torch.from_numpy(obs), gains).numpy()
        obs, reward, _, _, info = env.step(action)
        returns += reward
    q, _, memory = env.state()
    names = env.model.q_names
    x, y, yaw = (names.index(n) for n in ("box_slide.x", "box_slide.y", "box_turn.angle"))
    start = tangere.Batch(env.model)
    rest = start.bodies()[0][0, env.model.body_names.index("box"), 0] - start.q[0, x]  # [m]
    place = np.hypot(q[:, x] + rest - memory[:, 0], q[:, y] - memory[:, 1])
    return {
        "position_m": float(place.mean()),
        "yaw_rad": float(np.abs(q[:, yaw] - memory[:, 2]).mean()),
        "return": float(returns.mean()),
        "success": float(info["success"].mean()),
    }


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    tasks = [name for name in tangere.task_names() if name.startswith("box_pushing")]
    parser.add_argument("task", nargs="?", default="box_pushing", choices=tasks)
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--updates", type=int, default=300)
    parser.add_argument("--envs", type=int, default=16, help="episodes of an update")
    parser.add_argument("--rate", type=float, default=5e-3)
    parser.add_argument("--touch", type=float, default=1.0, help="factor of what is felt")
    limit = "most that a return may change per unit of one action; 0: no limit"
    parser.add_argument("--clip", type=float, default=0.0, help=limit)
    parser.add_argument("--goals", type=int, default=300, help="to test on")
    parser.add_argument("--threads", type=int, default=None)
    parser.add_argument("--json", action="store_true")
    asked = parser.parse_args()
    torch.set_num_threads(1)
    torch.manual_seed(asked.seed)

    begin, clock = time.process_time(), time.perf_counter()
    tape = tangere.torch.Tape(asked.task, asked.envs, threads=asked.threads, flatten=True)
    gains = touch_gains(tape.spec, asked.touch)
    policy = small_policy(len(gains), tape.spec.action.shape[0])
    optimiser = torch.optim.Adam(policy.parameters(), lr=asked.rate, betas=(0.7, 0.95))
    schedule = torch.optim.lr_scheduler.LambdaLR(
        optimiser, lambda k: 1 - (1 - 1e-5 / asked.rate) * k / asked.updates
    )
    def clipped(by_action: torch.Tensor) -> torch.Tensor:
        """Keeps an episode whose loop amplifies from owning the update."""
        norm = by_action.norm(dim=1, keepdim=True) * asked.envs  # of the episode's own return
        return by_action * (asked.clip / norm.clamp(min=1e-30)).clamp(max=1)

    best, kept, curve = -np.inf, None, []
    for update in range(asked.updates):
        obs = tape.reset(seed=1 + asked.seed, first_episode=update * asked.envs)
        total = torch.zeros(asked.envs, dtype=torch.float64)
        for _ in range(tape.actions):
            action = act(policy, obs, gains)
            if asked.clip > 0:
                action.register_hook(clipped)
            obs, reward, _ = tape.step(action)
            total = total + reward
        mean = float(total.mean())
        curve.append(mean)
        if mean > best:
            best, kept = mean, {k: v.clone() for k, v in policy.state_dict().items()}
        optimiser.zero_grad()
        (-total.mean()).backward()
        norm = nn.utils.clip_grad_norm_(policy.parameters(), 1.0)
        if torch.isfinite(norm):  # an update that overflowed teaches nothing
            optimiser.step()
        schedule.step()
        if update % 20 == 19 and not asked.json:
            state = f"return {mean:.1f}, gradient norm {float(norm):.3g}"
            print(f"update {update + 1}: {state}", flush=True)
    if kept is None:
        raise SystemExit("no update had a finite return; try a smaller --rate or --touch")
    policy.load_state_dict(kept)
    trained = time.process_time() - begin
    result = test(asked.task, policy, gains, asked.goals)
    if asked.json:
        print(json.dumps({"settings": vars(asked), "version": tangere.__version__, "curve": curve,
                          "train_cpu_s": trained, "test": result}))  # fmt: skip
        return
    print(
        f"{asked.task}, seed {asked.seed}: {result['position_m']:.3f} m, "
        f"{result['yaw_rad']:.3f} rad, return {result['return']:.0f}, success {result['success']:.2f}; {trained:.0f} CPU s, "
        f"{time.perf_counter() - clock:.0f} s on the clock"
    )


if __name__ == "__main__":
    main()
