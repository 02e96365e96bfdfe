# SPDX-License-Identifier: Apache-2.0
"""Box pushing by gradients through time: Adam on a policy, through 100 actions of simulation.

    python learning/gd.py box_pushing --seed 0

The settings are the published ones: 64–64 ELU, Adam 5e-3 → 1e-5, betas 0.7 and 0.95, gradient norm
at most 1, 16 episodes an update, 300 updates. Options change them.

The gradient of the mean return R = Σ_e R_e / E by the weights w is made in two passes. The first
goes back through the simulation and gives G_et = ∂R_e/∂a_et, all later reactions of the policy
included. The second is Σ_e s_e Σ_t G_et ∂a_et/∂w / E with the observations held. Between them one
sees how large an episode's G_e is: the loop may amplify derivatives, and then one episode of
10^5 times the others' size owns the update. `--limit k` sets s_e = min(1, k median|G| / |G_e|).
`--average d` plays, chooses and tests an average of the weights, w̄ ← d w̄ + (1 - d) w at every
update.

Every 10 updates the policy plays 300 goals of another seed. The one with the least mean error,
|Δp|/0.1 m + |Δθ|/0.276 rad in the reward's own proportion, is kept and tested on fresh goals. A few
updates can spoil a policy so far that the run never recovers. With `--back k`, a policy with more
than k times the least error is given up: the run goes on from the best one. The optimiser starts
anew, and from the second update on the rate is SLOWER times what it was.
Prints the mean errors in place [m] and yaw [rad].
"""

from __future__ import annotations

import argparse
import copy
import json
import sys
import time

import numpy as np
import torch
from protocol import CHOICE_EPISODES, CHOICE_SEED, TEST_SEED, merit, play, provenance
from torch import nn
from tracking import Log, add_log

import tangere
import tangere.torch

CHOICE_EVERY = 10  # updates
SLOWER = 0.7  # of the rate, each time a run goes back to its best policy


def small_policy(inputs: int, actions: int) -> nn.Module:
    return nn.Sequential(
        nn.Linear(inputs, 64), nn.ELU(), nn.Linear(64, 64), nn.ELU(), nn.Linear(64, actions)
    )


def act(policy: nn.Module, obs: torch.Tensor, gains: torch.Tensor) -> torch.Tensor:
    return torch.tanh(policy(obs * gains))


def touch_gains(spec: tangere.TaskSpec, gain: float) -> torch.Tensor:
    """(n): `gain` where an observation is touch, else 1."""
    parts = [
        torch.full((int(np.prod(t.shape)),), gain if t.touch else 1.0)
        for t in spec.observations
    ]
    return torch.cat(parts)


def player(policy: nn.Module, gains: torch.Tensor):
    """What `play` of protocol.py calls."""

    def choose(env, obs: np.ndarray, t: int) -> np.ndarray:
        with torch.no_grad():
            return act(policy, torch.from_numpy(obs), gains).numpy()

    return choose


def limited(by_action: torch.Tensor, limit: float) -> torch.Tensor:
    """G (A, E, na) with each episode's norm at most `limit` times the median of all.

    An episode whose derivatives overflowed counts nothing.
    """
    sound = torch.isfinite(by_action).all(dim=2).all(dim=0)[:, None]
    by_action = torch.where(sound, by_action, torch.zeros_like(by_action))
    norm = by_action.double().square().sum(dim=(0, 2)).sqrt()
    if limit <= 0:
        return by_action
    most = limit * norm.median()
    return by_action * (most / norm.clamp(min=1e-30)).clamp(max=1).to(by_action.dtype)[:, None]


def update(
    tape: tangere.torch.Tape, policy: nn.Module, gains: torch.Tensor, limit: float,
    seed: int, first_episode: int,
) -> float:  # fmt: skip
    """Leaves the gradient of minus the mean return in the policy's weights; returns that mean."""
    obs = tape.reset(seed=seed, first_episode=first_episode)
    seen, by_action = [], [torch.zeros(())] * tape.actions
    total = torch.zeros(tape.num_envs, dtype=torch.float64)
    for t in range(tape.actions):
        seen.append(obs.detach())
        action = act(policy, obs, gains)
        action.register_hook(lambda g, t=t: by_action.__setitem__(t, g))
        obs, reward, _ = tape.step(action)
        total = total + reward
    total.sum().backward()
    for p in policy.parameters():
        p.grad = None  # of the unlimited episodes
    weights = limited(torch.stack(by_action), limit)
    actions = act(policy, torch.stack(seen), gains)
    (-(weights * actions).sum() / tape.num_envs).backward()
    return float(total.detach().mean())


def settings() -> argparse.Namespace:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    tasks = [name for name in tangere.task_names() if name.startswith("box_pushing")]
    parser.add_argument("task", nargs="?", default="box_pushing", choices=tasks)
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--updates", type=int, default=300)
    parser.add_argument("--envs", type=int, default=16, help="episodes of an update")
    parser.add_argument("--rate", type=float, default=5e-3)
    parser.add_argument("--touch", type=float, default=1.0, help="factor of what is felt")
    limit = "most that an episode counts, in medians of the update's episodes; 0: no limit"
    parser.add_argument("--limit", type=float, default=0.0, help=limit)
    back = "errors, in those of the best policy, from which the run goes back to it; 0: never"
    parser.add_argument("--back", type=float, default=0.0, help=back)
    average = "decay of the average of weights that is played; 0: the last weights"
    parser.add_argument("--average", type=float, default=0.0, help=average)
    parser.add_argument("--goals", type=int, default=1000, help="to test on")
    parser.add_argument("--threads", type=int, default=None)
    parser.add_argument("--json", action="store_true")
    add_log(parser)
    return parser.parse_args()


def main() -> None:
    args = settings()
    torch.set_num_threads(1)
    torch.manual_seed(args.seed)

    begin, clock = time.process_time(), time.perf_counter()
    tape = tangere.torch.Tape(args.task, args.envs, threads=args.threads, flatten=True)
    gains = touch_gains(tape.spec, args.touch)
    policy = small_policy(len(gains), tape.spec.action.shape[0])
    shown = copy.deepcopy(policy)
    optimiser = torch.optim.Adam(policy.parameters(), lr=args.rate, betas=(0.7, 0.95))
    went_back: list[int] = []  # after which updates
    schedule = torch.optim.lr_scheduler.LambdaLR(
        optimiser,
        lambda k: SLOWER ** len(went_back) * (1 - (1 - 1e-5 / args.rate) * k / args.updates),
    )
    still = {"flatten": True, "autoreset": "disabled", "threads": args.threads}
    choice = tangere.make_vec(args.task, CHOICE_EPISODES, **still)
    best, kept, curve, chosen = (-np.inf,), None, [], []
    log = Log(args.log)
    for k in range(args.updates):
        curve.append(update(tape, policy, gains, args.limit, 1 + args.seed, k * args.envs))
        log(k + 1, train_return=curve[-1])
        norm = nn.utils.clip_grad_norm_(policy.parameters(), 1.0)
        if torch.isfinite(norm):  # an update that overflowed teaches nothing
            optimiser.step()
        schedule.step()
        with torch.no_grad():
            decay = args.average if k else 0.0
            for mean, now in zip(shown.parameters(), policy.parameters()):
                mean.copy_(decay * mean + (1 - decay) * now)
        if (k + 1) % CHOICE_EVERY and k + 1 < args.updates:
            continue
        played = play(choice, CHOICE_SEED, player(shown, gains)).summary()
        chosen.append([k + 1, played["return"], played["position_m"], played["yaw_rad"]])
        log(k + 1, **played)
        if merit(played) > best:
            best, kept = merit(played), copy.deepcopy(shown)
        elif args.back and kept is not None and not merit(played)[0] > args.back * best[0]:
            went_back.append(k + 1)
            policy.load_state_dict(kept.state_dict())
            shown.load_state_dict(kept.state_dict())
            optimiser.state.clear()
        errors = f"{played['position_m']:.3f} m, {played['yaw_rad']:.3f} rad"
        print(f"update {k + 1}: return {played['return']:.1f}, {errors}, "
              f"gradient norm {float(norm):.3g}", file=sys.stderr, flush=True)  # fmt: skip
    if kept is None:
        raise SystemExit("no policy had a finite error; try a smaller --rate or --touch")
    trained = {"train_cpu_s": time.process_time() - begin,
               "train_wall_s": time.perf_counter() - clock}  # fmt: skip
    goals = tangere.make_vec(args.task, args.goals, **still)
    result = play(goals, TEST_SEED, player(kept, gains)).summary()
    if args.json:
        print(json.dumps({"program": "gd", "settings": vars(args), **provenance(), **trained,
                          "steps": args.updates * args.envs * tape.actions,
                          "curve": curve, "choice": chosen, "went_back": went_back,
                          "test": result}))  # fmt: skip
        return
    print(
        f"{args.task}, seed {args.seed}: {result['position_m']:.3f} m, "
        f"{result['yaw_rad']:.3f} rad, return {result['return']:.0f}, success "
        f"{result['success']:.2f}; {trained['train_cpu_s']:.0f} CPU s, "
        f"{trained['train_wall_s']:.0f} s on the clock"
    )


if __name__ == "__main__":
    main()
