# SPDX-License-Identifier: Apache-2.0
"""The tables and pictures of docs/accuracy.md, by one command.

    python3 bench/accuracy_page.py [--keep out/accuracy] [--fresh] [SCENE ...]

It runs `tangere accuracy` on every scene and prints the tables as Markdown. `--fresh` also plays
100 episodes with random numbers that the advice has not seen. `--keep` names a folder for the
answers and the pictures (SCENE.svg). Answers that are there are not computed again.
"""

import argparse
from pathlib import Path

from advice_check import (
    FRESH,
    ROOT,
    advised_there,
    best_fixed,
    cut_point,
    name,
    percent,
    rate,
    sweep,
)

SCENES = ["rolling_ball_small", "box_pushing", "cap_opening", "insertion"]
SCHEMES = ["BDF1", "BDF2", "SDIRK2", "SDIRK3"]
ACCURACIES = [0.1, 0.01, 0.001, 0.0001]


def table(head: list[str], rows: list[list[str]]) -> None:
    for row in (head, ["---"] * len(head), *rows):
        print("| " + " | ".join(row) + " |")
    print()


def cell(point: dict | None) -> str:
    if point is None:
        return ""
    return "fails" if point["error"] is None else f"{percent(point)}, {rate(point):.3g}"


def fixed(answer: dict, scheme: str, step: float) -> dict | None:
    return next((p for p in answer["points"]
                 if p["scheme"] == scheme and abs(p["step"] - step) < 1e-9
                 and p["accuracy"] == 0 and p["precision"] == "double"), None)


def advice_cell(answer: dict) -> str:
    advice = answer["advice"]
    if not advice["resolved"]:
        return "not resolved"
    return f"{name(advice)}: {cell(advice)}" if "scheme" in advice else "none"


def main() -> None:
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--tangere", type=Path, default=ROOT / "build" / "release" / "tangere")
    parser.add_argument("--keep", type=Path, default=ROOT / "out" / "accuracy")
    parser.add_argument("--fresh", action="store_true")
    parser.add_argument("--envs", default="64", help="environments whose advice is taken")
    parser.add_argument("scenes", nargs="*", default=SCENES)
    args = parser.parse_args()
    args.keep.mkdir(parents=True, exist_ok=True)

    def answer(scene: str, kind: str, *more: str) -> dict:
        return sweep(args.tangere, str(ROOT / "scenes" / f"{scene}.xml"), 0.01, *more,
                     kept=args.keep / f"{scene}{kind}.json")

    found = {}
    for scene in args.scenes:
        svg = args.keep / f"{scene}.svg"
        found[scene] = answer(scene, "", "--svg", str(svg), "--overwrite", "--envs", args.envs)
    first = next(iter(found.values()))
    print(f"{first['machine']}, {first['isa']}; error, then simulated seconds per CPU second\n")
    table(["scene", *[f"{scheme} 5 ms" for scheme in SCHEMES]],
          [[scene, *[cell(fixed(a, scheme, 5e-3)) for scheme in SCHEMES]]
           for scene, a in found.items()])
    table(["scene", "advice for 1 %"], [[scene, advice_cell(a)] for scene, a in found.items()])
    table(["scene", *[f"{accuracy:g}" for accuracy in ACCURACIES]],
          [[scene, *[cell(cut_point(a, accuracy)) for accuracy in ACCURACIES]]
           for scene, a in found.items()])
    if not args.fresh:
        return
    rows = []
    for scene, a in found.items():
        fresh = answer(scene, "_fresh", *FRESH)
        advice, there, gain = advised_there(a, fresh, 0.01)
        cut = cut_point(fresh, 0.01)
        best = best_fixed(fresh, cut)
        rows.append([scene,
                     name(advice) if advice else "none",
                     f"{percent(advice)}, {percent(there)}" if advice else "",
                     f"{gain:.2f}" if advice else "",
                     f"{percent(cut, 'median_error')}, {percent(cut)}",
                     f"{100 * cut['within_share']:.0f}",
                     f"{rate(best) / rate(cut):.2f}" if best else ""])
    table(["scene", "advice for 1 %", "its error where chosen, and afresh",
           "fastest that meets 1 % afresh", "accuracy 0.01: middle, 95 of 100",
           "within 0.3 to 3 times", "its cost over the best fixed step"], rows)


if __name__ == "__main__":
    main()
