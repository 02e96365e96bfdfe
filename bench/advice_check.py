# SPDX-License-Identifier: Apache-2.0
"""Whether the advice of `tangere accuracy` holds in episodes that it has not seen.

    python3 bench/advice_check.py [--tangere build/release/tangere] [--target 0.01] SCENE.xml ...

For each scene it takes the advice of 64 environments, then plays 100 others, whose random numbers
are new, with every setting. It prints how large the error of the advised setting is there (95 of
100 stay below it), and how much faster the fastest of the settings is that meet the target there.
For steps that are cut with the target as their accuracy it prints in how many of the 100 the error
is 0.3 to 3 times what was asked, and their cost over that of the best fixed step.
"""

import argparse
import json
import subprocess
from pathlib import Path

ROOT = Path(__file__).resolve().parent.parent
FRESH = ["--envs", "100", "--seed", "1000"]


def sweep(tangere: Path, scene: str, target: float, *more: str, kept: Path | None = None) -> dict:
    """Runs `tangere accuracy`. `kept`: the file with its answer, which is made if it is missing."""
    if kept is not None and kept.exists():
        return json.loads(kept.read_text())
    command = [str(tangere), "accuracy", scene, "--target", str(target), "--threads", "1", "--json"]
    command += more
    run = subprocess.run(command, capture_output=True, text=True, check=False)
    if run.returncode not in (0, 1):
        raise SystemExit(run.stderr)
    if kept is not None:
        kept.write_text(run.stdout)
    return json.loads(run.stdout)


def key(point: dict) -> tuple:
    return point["scheme"], round(point["step"], 9), point["accuracy"], point["precision"]


def name(point: dict) -> str:
    cut = f", accuracy {point['accuracy']:g}" if point["accuracy"] else ""
    return f"{point['scheme']}, {1e3 * point['step']:g} ms{cut}"


def rate(point: dict) -> float:
    return point["simulated_seconds_per_cpu_second"]


def percent(point: dict, error: str = "error") -> str:
    return f"{100 * point[error]:.2g} %"


def meets(point: dict, target: float) -> bool:
    return point["error"] is not None and point["error"] <= target


def advised_there(answer: dict, fresh: dict, target: float) -> tuple:
    """The advice, the same setting in fresh episodes, and how much faster the fastest is that meets
    the target there. None, None, 0 without an advice."""
    advice = answer["advice"]
    if "scheme" not in advice:
        return None, None, 0
    there = next(p for p in fresh["points"] if key(p) == key(advice))
    good = [p for p in fresh["points"] if meets(p, target)]
    return advice, there, rate(max(good, key=rate, default=there)) / rate(there)


def cut_point(answer: dict, accuracy: float) -> dict:
    return next(p for p in answer["points"]
                if p["accuracy"] == accuracy and p["precision"] == "double")


def best_fixed(answer: dict, cut: dict) -> dict | None:
    """The fastest setting of whole steps whose error is at most that of the cut steps."""
    whole = [p for p in answer["points"]
             if p["accuracy"] == 0 and p["precision"] == "double" and meets(p, cut["error"])]
    return max(whole, key=rate, default=None)


def check(tangere: Path, scene: str, target: float) -> None:
    print(f"{Path(scene).stem}, {100 * target:g} %")
    answer = sweep(tangere, scene, target)
    if not answer["advice"]["resolved"]:
        print("  not resolved")
        return
    fresh = sweep(tangere, scene, target, *FRESH)
    advice, there, gain = advised_there(answer, fresh, target)
    if advice:
        print(f"  advice {name(advice)}: {percent(advice)}, in 100 fresh episodes {percent(there)}")
        print(f"  fastest that meets the target there: {gain:.2f} x as fast")
    else:
        print(f"  {answer['advice']['text']}")
    cut = cut_point(fresh, target)
    print(f"  asked for {target:g}: {percent(cut, 'median_error')} in the middle, "
          f"{percent(cut)} in 95 of 100; {100 * cut['within_share']:.0f} of 100 within 0.3 to 3 "
          "times")
    best = best_fixed(fresh, cut)
    if best:
        cost = rate(best) / rate(cut)
        print(f"  its cost: {cost:.2f} times that of {name(best)} with {percent(best)}")


def main() -> None:
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--tangere", type=Path, default=ROOT / "build" / "release" / "tangere")
    parser.add_argument("--target", type=float, default=0.01)
    parser.add_argument("scenes", nargs="+")
    args = parser.parse_args()
    for scene in args.scenes:
        check(args.tangere, scene, args.target)


if __name__ == "__main__":
    main()
