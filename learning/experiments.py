# SPDX-License-Identifier: Apache-2.0
"""Which runs make the tables of learning/README.md, and a way to make those that are missing.

    python learning/experiments.py --list
    python learning/experiments.py --only gd-touch ppo-box --jobs 2

A run is one command with one seed. What it prints with --json is kept as
learning/results/NAME-SEED.json, with the command, the arguments of its data set and the commit. A
file that has the same command and arguments as here is not made again; another one is stale and
does not count. Data sets go to out/. Every program runs on one thread. With `--device cuda` those
that learn from batches have their networks on a GPU. ./run-learning builds what is needed and calls
this.
"""

from __future__ import annotations

import argparse
import json
import os
import subprocess
import sys
import time
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from skins import SKINS

ROOT = Path(__file__).parents[1]
RESULTS = Path(__file__).parent / "results"


@dataclass
class Experiment:
    """Runs that differ by their seed alone, and their row in a table."""

    name: str
    command: str  #: program and arguments
    seeds: int
    seconds: int  #: CPU time that a run is expected to take; an estimate until it is measured
    row: str  #: what the table says it is
    paper: str = ""  #: what the paper has there
    data: str = ""  #: arguments of `tangere generate`; the data set is out/learning/NAME
    first_seed: int = 0  #: of its runs; 5 if settings were compared in runs of the seeds before


PUSHES = "box_pushing --episodes 5000 --seed 1"
MIXED = "box_pushing --episodes 1000 --seed 1 --noise 0.3 --mix random=0.5"
DERIVED = "box_pushing --episodes 150 --seed 1 --noise 0.3 --gradients jacobians"
CAPS = "cap_opening --episodes 300 --seed 1"
TURNS = "in_hand --episodes 1000 --seed 1"
GRASPS = "stable_grasp --episodes 1000 --seed 1"
INSERTIONS = "insertion --episodes 5000 --seed 1"
THROUGH_TIME = "gd.py box_pushing --touch 0.05"
CLONED = "dagger.py out/learning/pushes --rounds 60 --updates 100"
TURNED = "dagger.py out/learning/turns --rounds 10 --updates 150 --visits 200"
SEEN = "pictures.py out/learning/pictures"
INSERTED = "pictures.py out/learning/inserts --task insertion --demos 5000 --epochs 60"
CAPPED = "bc.py out/learning/caps --epochs 20 --before 3 --width 512"

OTHER_SKINS = {
    skin: " ".join(f"--play-skin {other}" for other in SKINS if other != skin) for skin in SKINS
}

# In the order in which they are made: what is worth most and costs least comes first.
EXPERIMENTS = [
    Experiment("gd-touch", f"{THROUGH_TIME} --limit 3 --back 1.5 --envs 64 --updates 1200", 5, 290,
               "GD, goal and touch", "0.058, 0.074"),
    Experiment("gd-touch-short", f"{THROUGH_TIME} --limit 10 --back 1.5", 5, 60,
               "GD, goal and touch, short", "0.058, 0.074"),
    Experiment("ppo-box", "ppo.py box_pushing", 5, 180, "PPO, goal and touch", "0.123, 0.241",
               first_seed=5),
    Experiment("gd-privileged", "gd.py box_pushing_privileged", 5, 60,
               "GD, goal and box", "0.037, 0.043"),
    Experiment("gd-reduced", "gd.py box_pushing_reduced", 5, 60, "GD, goal", "0.126, 0.255"),
    Experiment("ppo-rotation", "ppo.py insertion_rotation", 5, 140,
               "insertion, yaw, imitates 3/10", "100 %, 1.53", first_seed=5),
    Experiment("ppo-translation", "ppo.py insertion_translation", 5, 50,
               "insertion, x and y, imitates 1/2", "100 %, 2.33", first_seed=5),
    Experiment("ppo-insertion", "ppo.py insertion", 5, 140, "insertion, all", "83 %, 4.81",
               first_seed=5),
    Experiment("ppo-grasp", "ppo.py stable_grasp", 5, 90, "stable grasp, flow", "98.5 %, 2.1"),
    Experiment("ppo-cap-blind", "ppo.py cap_opening_blind", 3, 470,
               "cap, blind, imitates 3/10", "59.7 %", first_seed=5),
    Experiment("ppo-cap", "ppo.py cap_opening", 5, 300,
               "cap, touch, imitates 4/5", "87.3 %", first_seed=5),
    *(Experiment(f"skin-{skin}", f"ppo.py stable_grasp --skin {skin} {OTHER_SKINS[skin]}", 3, 60,
                 f"grasp, {skin}")
      for skin in ("springs", "layer")),
    *(Experiment(f"skin-{skin}-insertion",
                 f"ppo.py insertion_translation --skin {skin} {OTHER_SKINS[skin]}", 3, 100,
                 f"insert, {skin}")
      for skin in ("springs", "layer")),
    Experiment("bc-push", CLONED, 3, 450, "box pushing, goal and touch, visits",
               data=f"pushes {PUSHES}", first_seed=5),
    Experiment("bc-push-blind", f"{CLONED} --without tactile", 3, 350, "box pushing, goal, visits",
               data=f"pushes {PUSHES}", first_seed=5),
    Experiment("bc-grasp", "bc.py out/learning/grasps", 3, 10, "stable grasp, flow",
               data=f"grasps {GRASPS}"),
    Experiment("bc-insertion", "bc.py out/learning/insertions --epochs 60 --before 4 --recall", 3,
               200, "insertion, flow", data=f"insertions {INSERTIONS}", first_seed=5),
    Experiment("bc-cap", CAPPED, 3, 200, "cap, touch", data=f"caps {CAPS}"),
    Experiment("bc-cap-blind", f"{CAPPED} --without tactile", 3, 60, "cap, blind",
               data=f"caps {CAPS}"),
    Experiment("bc-in-hand", TURNED, 2, 330, "in hand, touch, visits", data=f"turns {TURNS}"),
    Experiment("bc-in-hand-blind", f"{TURNED} --without tactile", 2, 330, "in hand, blind, visits",
               data=f"turns {TURNS}"),
    *(Experiment(f"see-{name}", f"{SEEN} --see {keys}", 2, 60, text)
      for name, keys, text in (
          ("markers", "left.rgb_marker right.rgb_marker", "pictures of both gels, with markers"),
          ("flow", "flow", "flow of both pads"),
          ("eye-markers", "eye left.rgb_marker right.rgb_marker",
           "camera and pictures with markers"),
          ("eye", "eye", "camera on the hand"),
          ("gels", "left.rgb right.rgb", "pictures of both gels, without markers"))),
    *(Experiment(f"insertion-{name}", f"{INSERTED} --see {keys}", 1, seconds, text)
      for name, keys, seconds, text in (
          ("flow", "flow", 590, "flow of both pads"),
          ("markers", "left.rgb_marker right.rgb_marker left.rgb_marker_grip right.rgb_marker_grip",
           400, "pictures with markers, grip and rim"),
          ("gels", "left.rgb right.rgb left.rgb_grip right.rgb_grip", 400,
           "pictures without markers, grip and rim"))),
    *(Experiment(f"match-{name}", f"matching.py out/learning/derived --match {weight}", 3, 60,
                 text, data=f"derived {DERIVED}")
      for name, weight, text in (("none", 0, "rows alone"), ("some", 0.01, "weight 0.01"),
                                 ("more", 0.1, "weight 0.1"))),
    *(Experiment(f"offline-{method}", f"offline.py out/learning/mixed --method {method}", 3,
                 seconds, text, data=f"mixed {MIXED}")
      for method, seconds, text in (("bc", 60, "cloning"), ("td3", 250, "TD3 with cloning"),
                                    ("iql", 250, "implicit Q-learning"))),
]  # fmt: skip


WITH_DEVICE = ("ppo.py", "bc.py")  # programs that have --device


def result_of(experiment: Experiment, seed: int) -> Path:
    return RESULTS / f"{experiment.name}-{seed}.json"


def seeds(experiment: Experiment) -> range:
    """The seeds of its runs."""
    return range(experiment.first_seed, experiment.first_seed + experiment.seeds)


def made_by(experiment: Experiment) -> dict[str, str]:
    """What a result says of the experiment that it belongs to."""
    return {"command": experiment.command, "data": experiment.data}


def stored(experiment: Experiment, seed: int) -> dict[str, Any] | None:
    """The result of a run; None if there is none, or one of another command or data set."""
    path = result_of(experiment, seed)
    if not path.exists():
        return None
    result = json.loads(path.read_text())
    return result if result.get("experiment") == made_by(experiment) else None


def commit() -> str:
    """The commit that is checked out, with "-dirty" if files other than results differ from it; ""
    without git."""

    def git(*words: str) -> str:
        return subprocess.run(
            ["git", *words], cwd=ROOT, stdin=subprocess.DEVNULL, capture_output=True, text=True,
            check=True,
        ).stdout.strip()  # fmt: skip

    try:
        name = git("describe", "--always", "--abbrev=12")
        changed = git("diff", "--name-only", "HEAD", "--", ".", ":!learning/results")
        return name + ("-dirty" if changed else "")
    except (OSError, subprocess.CalledProcessError):
        return ""


def make_data(experiment: Experiment) -> None:
    """Generates the data set of an experiment if it is not there."""
    name, _, arguments = experiment.data.partition(" ")
    folder = ROOT / "out/learning" / name
    folder.parent.mkdir(parents=True, exist_ok=True)
    if not name or (folder / "robomimic.hdf5").exists():
        return
    print(f"data set: tangere generate {arguments}", flush=True)
    done = subprocess.run(
        [ROOT / "build/release/tangere", "generate", *arguments.split(), "--output", folder,
         "--overwrite", "--quiet"],
        cwd=ROOT, stdin=subprocess.DEVNULL,
    )  # fmt: skip
    if done.returncode not in (0, 1):  # 1: some episodes failed and are kept apart
        raise SystemExit(f"the data set {name} could not be made (reason above)")


def command_of(experiment: Experiment, seed: int, device: str) -> list[str]:
    """The words after the interpreter."""
    program, *arguments = experiment.command.split()
    command = [f"learning/{program}", *arguments, "--seed", str(seed), "--json"]
    command += ["--threads", "1"] if program != "matching.py" else []
    return command + (["--device", device] if program in WITH_DEVICE else [])


def make(experiment: Experiment, seed: int, device: str) -> bool:
    """Makes one result; says how it went and returns whether it is there."""
    command = [sys.executable, *command_of(experiment, seed, device)]
    begin = time.perf_counter()
    done = subprocess.run(
        command, cwd=ROOT, env=os.environ | {"OMP_NUM_THREADS": "1"}, stdin=subprocess.DEVNULL,
        capture_output=True, text=True,
    )  # fmt: skip
    took = f"{time.perf_counter() - begin:.0f} s"
    if done.returncode != 0:
        print(f"{experiment.name} {seed} failed after {took}: {' '.join(command)}\n{done.stderr}",
              file=sys.stderr, flush=True)  # fmt: skip
        return False
    partial = result_of(experiment, seed).with_suffix(".part")
    said = {"experiment": made_by(experiment), "commit": commit()} | json.loads(done.stdout)
    partial.write_text(json.dumps(said) + "\n")
    partial.rename(result_of(experiment, seed))
    print(f"{experiment.name} {seed}: {took}", flush=True)
    return True


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    names = [experiment.name for experiment in EXPERIMENTS]
    parser.add_argument("--only", nargs="+", choices=names, default=names, metavar="NAME")
    parser.add_argument("--seeds", type=int, help="at most; the default is each one's own number")
    parser.add_argument("--jobs", type=int, default=os.cpu_count() or 1, help="at once")
    parser.add_argument("--device", default="cpu", help="of networks that learn from batches")
    parser.add_argument("--list", action="store_true", help="say what there is and what it costs")
    args = parser.parse_args()
    wanted = [e for e in EXPERIMENTS if e.name in args.only]
    runs = [(e, s) for e in wanted for s in seeds(e)[:args.seeds]
            if stored(e, s) is None]  # fmt: skip
    if args.list:
        for e in wanted:
            missing = sum(run[0] is e for run in runs)
            stale = sum(run[0] is e and result_of(*run).exists() for run in runs)
            print(f"{e.name:16} {e.seeds} runs of {e.seconds:5} CPU s, {missing} missing, "
                  f"{stale} of them stale: {e.command}")  # fmt: skip
        return
    print(f"{len(runs)} runs, about {sum(e.seconds for e, _ in runs) / 60:.0f} CPU minutes, "
          f"{args.jobs} at once", flush=True)  # fmt: skip
    RESULTS.mkdir(exist_ok=True)
    for experiment in {e.name: e for e, _ in runs}.values():
        make_data(experiment)
    with ThreadPoolExecutor(args.jobs) as pool:
        made = list(pool.map(lambda run: make(*run, args.device), runs))
    if not all(made):
        raise SystemExit(f"{made.count(False)} of {len(made)} runs failed (reasons above)")


if __name__ == "__main__":
    main()
