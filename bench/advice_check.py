# SPDX-License-Identifier: Apache-2.0
"""Whether the advice of `tangere accuracy` holds in episodes that it has not seen.

    python3 bench/advice_check.py [--tangere build/release/tangere] [--target 0.01] SCENE.xml ...

For each scene it takes the advice of 32 environments, then plays 100 others, whose random numbers
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


def sweep(tangere: Path, scene: str, target: float, *more: str) -> dict:
    command = [str(tangere), "accuracy", scene, "--target", str(target), "--threads", "1", "--json"]
    command += more
    run = subprocess.run(command, capture_output=True, text=True, check=False)
    if run.returncode not in (0, 1):
        raise SystemExit(run.stderr)
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


def check(tangere: Path, scene: str, target: float) -> None:
    print(f"{Path(scene).stem}, {100 * target:g} %")
    advice = sweep(tangere, scene, target)["advice"]
    fresh = sweep(tangere, scene, target, *FRESH)
    if not advice["resolved"]:
        print("  not resolved")
        return
    good = [p for p in fresh["points"] if p["error"] is not None and p["error"] <= target]
    if "scheme" in advice:
        there = next(p for p in fresh["points"] if key(p) == key(advice))
        fastest = max(good, key=rate, default=there)
        print(f"  advice {name(advice)}: {percent(advice)}, in 100 fresh episodes {percent(there)}")
        gain = rate(fastest) / rate(there)
        print(f"  fastest that meets the target there: {name(fastest)}, {gain:.2f} x as fast")
    double = [p for p in fresh["points"] if p["precision"] == "double"]
    for p in (p for p in double if p["accuracy"] == target):
        within = f"{100 * p['within_share']:.0f} of 100 within 0.3 to 3 times"
        print(f"  asked for {target:g}: {percent(p, 'median_error')} in the middle, "
              f"{percent(p)} in 95 of 100; {within}")
        fixed = [q for q in double if q["accuracy"] == 0 and q["error"] is not None]
        fixed = [q for q in fixed if q["error"] <= p["error"]]
        if fixed:
            best = max(fixed, key=rate)
            cost = rate(best) / rate(p)
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
