# SPDX-License-Identifier: Apache-2.0
"""The tables of learning/README.md, and a figure, from learning/results and nothing else.

    python learning/report.py             # prints the tables
    python learning/report.py --write     # puts them into the README, and draws the figure

A number is the mean over runs. ± is half of a 95 % interval: Student's over the runs; for rates of
success the larger of that and Wilson's over the episodes of a test, which all runs share. An error
of one run has no interval.
"""

from __future__ import annotations

import argparse
from pathlib import Path
from typing import Any, Sequence

import numpy as np
import experiments
from experiments import EXPERIMENTS, Experiment
from protocol import CHOICE_EPISODES, EARLIER_TEST_SEED, TEST_SEED, student, wilson
from skins import SKINS

import tangere

PAGE = Path(__file__).parent / "README.md"
FIGURE = Path(__file__).parent / "results" / "box_pushing.svg"
MATCHED = (1, 2, 5, 10, 25, 100)  # episodes that a model is learned from
BEGIN, END = "<!-- made by report.py -->\n", "<!-- end of what report.py made -->\n"


def stored(experiment: Experiment) -> list[dict[str, Any]]:
    """The results of an experiment that are there and not stale, by seed."""
    found = [experiments.stored(experiment, seed) for seed in experiments.seeds(experiment)]
    return [result for result in found if result is not None]


def mean(values: Sequence[float], unit: str = "", digits: int = 3) -> str:
    text = f"{np.mean(values):.{digits}f}"
    if len(values) > 1:
        text += f" ± {student(values):.{digits}f}"
    return text + unit


def rate(runs: list[dict[str, Any]]) -> str:
    """Successes in percent."""
    rates = [run["test"]["success"] for run in runs]
    low, high = wilson(float(np.mean(rates)), min(run["test"]["episodes"] for run in runs))
    half = (high - low) / 2
    if len(rates) > 1:
        half = max(half, student(rates))
    return f"{100 * np.mean(rates):.1f} ± {100 * half:.1f} %"


def tested(runs: list[dict[str, Any]], name: str) -> list[float]:
    return [run["test"][name] for run in runs]


def until(runs: list[dict[str, Any]]) -> str:
    """Actions of the episodes that were solved, of the runs that solved any."""
    counts = [run["test"]["actions_solved"] for run in runs if run["test"]["success"] > 0]
    return mean(counts, "", 2) if counts else "–"


def cost(runs: list[dict[str, Any]]) -> str:
    return f"{np.mean([run['train_cpu_s'] for run in runs]):.0f}"


def steps(runs: list[dict[str, Any]]) -> str:
    """Actions of the training [million]."""
    return f"{runs[0]['steps'] / 1e6:.2f}"


def choosing(runs: list[dict[str, Any]]) -> str:
    """Actions of the episodes by which the best policy of a run is chosen [million]: at most,
    because episodes may end before the horizon."""
    horizon = tangere.task_spec(runs[0]["settings"]["task"]).horizon
    return f"{len(runs[0]['choice']) * CHOICE_EPISODES * horizon / 1e6:.2f}"


def table(head: str, beginnings: tuple[str, ...], row) -> str:
    """A row for each experiment that has results and whose name begins so; "" without any."""
    columns = head.count("|") - 1
    lines = [head, "|" + "---|" * columns]
    for experiment in EXPERIMENTS:
        if not experiment.name.startswith(beginnings):
            continue
        runs = stored(experiment)
        if runs:
            cells = [experiment.row, *row(runs), f"{len(runs)}", experiment.paper]
            lines.append("| " + " | ".join(cells[:columns]).rstrip() + " |")
    return "\n".join(lines) + "\n" if len(lines) > 2 else ""


def turned(text: str) -> str:
    """The same table with rows and columns exchanged."""
    rows = [line.strip("| ").split(" | ") for line in text.splitlines() if "---" not in line]
    lines = ["| " + " | ".join(column) + " |" for column in zip(*rows)]
    return "\n".join([*lines[:1], "|" + "---|" * len(rows), *lines[1:]]) + "\n" if rows else ""


def published(what: str, beginnings: tuple[str, ...]) -> str:
    """A list of the paper's numbers for the experiments that table() shows; "" without any."""
    shown = [e for e in EXPERIMENTS if e.name.startswith(beginnings) and e.paper and stored(e)]
    lines = [f"- {e.row.partition(', imitates')[0]}: {e.paper}" for e in shown]  # that is ours
    return "\n".join([f"{what} in the paper:", "", *lines, ""]) if shown else ""


def missing() -> str:
    """A sentence with the runs that are still to be made; "" if there are none."""
    names = [f"`{e.name}` ({e.seeds - len(stored(e))})" for e in EXPERIMENTS
             if len(stored(e)) < e.seeds]  # fmt: skip
    return wrapped(f"Not run yet: {', '.join(names)}.") + "\n" if names else ""


def unclean() -> str:
    """A sentence with the runs of a tree that differed from its commit; "" if there are none."""
    dirty = {e.name: sum(r["commit"].endswith("-dirty") for r in stored(e)) for e in EXPERIMENTS}
    names = [f"`{name}` ({count})" for name, count in dirty.items() if count]
    said = "Runs of a tree that differed from its commit, perhaps by other results alone:"
    return wrapped(f"{said} {', '.join(names)}.") + "\n" if names else ""


def earlier() -> str:
    """A sentence with the rows of the earlier test episodes; "" if there are none."""
    seeds = {e.name: {r.get("test_seed", EARLIER_TEST_SEED) for r in stored(e)} for e in EXPERIMENTS
             if not e.name.startswith("match-")}  # those are tested on rows
    names = [f"`{name}`" for name, found in seeds.items() if found - {TEST_SEED}]
    said = f"Tested in the earlier 1000 episodes (seed {EARLIER_TEST_SEED}):"
    return wrapped(f"{said} {', '.join(names)}.") + "\n" if names else ""


def wrapped(text: str, width: int = 100) -> str:
    lines = [""]
    for word in text.split(" "):
        if len(lines[-1]) + len(word) >= width:
            lines.append("")
        lines[-1] += (" " if lines[-1] else "") + word
    return "\n".join(lines)


def tables() -> str:
    """What stands in the README between the two marks."""
    of_pushing = ("gd-", "ppo-box")
    of_tasks = tuple(
        e.name for e in EXPERIMENTS if e.name.startswith("ppo-") and e.name not in of_pushing
    )
    pushed = table(
        "| box pushing | place [m] | yaw [rad] | success | actions [M] | choice [M] | CPU [s] "
        "| runs |", of_pushing,
        lambda runs: [mean(tested(runs, "position_m")), mean(tested(runs, "yaw_rad")),
                      rate(runs), steps(runs), choosing(runs), cost(runs)],
    )  # fmt: skip
    reinforced = table(
        "| PPO | success | actions until it | actions [M] | choice [M] | CPU [s] | runs |",
        of_tasks,
        lambda runs: [rate(runs), until(runs), steps(runs), choosing(runs), cost(runs)],
    )  # fmt: skip
    cloned = table(
        "| clone | success | script | rows | CPU [s] | runs |", ("bc-",),
        lambda runs: [rate(runs), f"{100 * runs[0]['script']['success']:.1f} %",
                      f"{runs[0]['rows']}", cost(runs)],
    )  # fmt: skip
    seen = table(
        "| clone of stable grasp by | success | grasps after the first | rows | CPU [s] | runs |",
        ("see-",),
        lambda runs: [rate(runs), until(runs), f"{runs[0]['rows']}", cost(runs)],
    )
    inserted = table(
        "| clone of insertion by | success | script | actions until it | rows | CPU [s] | runs |",
        ("insertion-",),
        lambda runs: [rate(runs), f"{100 * runs[0]['script']['success']:.1f} %", until(runs),
                      f"{runs[0]['rows']}", cost(runs)],
    )  # fmt: skip
    skins = table(
        "| PPO of … on | " + " | ".join(SKINS) + " | runs |", ("skin-",),
        lambda runs: [rate([run | {"test": run["tests"].get(skin, run["test"])} for run in runs])
                      for skin in SKINS],
    )  # fmt: skip
    offline = table(
        "| mixed data | score | success | CPU [s] | runs |", ("offline-",),
        lambda runs: [mean(tested(runs, "score"), "", 1), rate(runs), cost(runs)],
    )  # fmt: skip
    matched = turned(table(
        "| episodes | " + " | ".join(str(n) for n in MATCHED) + " | CPU [s] | runs |", ("match-",),
        lambda runs: [*(mean([dict(map(tuple, run["curve"]))[n] for run in runs])
                        for n in MATCHED), cost(runs)],
    ))  # fmt: skip
    picture = "![Return against actions of training](results/box_pushing.svg)\n" if figure() else ""
    parts = (pushed, published("Place [m] and yaw [rad]", of_pushing), picture, reinforced,
             published("Success, and actions until it", of_tasks), cloned, seen, inserted, skins,
             offline, matched, earlier(), unclean(), missing())  # fmt: skip
    return "\n" + "\n".join(filter(None, parts)) + "\n"


def polyline(points: np.ndarray, low: np.ndarray, high: np.ndarray) -> str:
    place = (points - low) / (high - low)
    return " ".join(f"{60 + 520 * x:.1f},{270 - 240 * y:.1f}" for x, y in np.clip(place, 0, 1))


def figure() -> str:
    """SVG: mean return in the goals of choice against actions of training, a line a run."""
    colours = {"gd-privileged": "#2a7", "gd-reduced": "#999", "gd-touch": "#c33", "ppo-box": "#36c"}
    curves = []
    for experiment in EXPERIMENTS:
        for run in stored(experiment) if experiment.name in colours else []:
            each = run["steps"] / run["settings"]["updates"] if run["program"] == "gd" else 1
            points = [[row[0] * each, row[1]] for row in run["choice"]]
            curves.append((experiment, np.asarray(points, float)))
    if not curves:
        return ""
    longest = max(points[-1, 0] for _, points in curves)
    low, high = np.array([0.0, -800.0]), np.array([longest, 0.0])
    lines = ['<svg xmlns="http://www.w3.org/2000/svg" viewBox="0 0 620 320" '
             'font-family="sans-serif" font-size="12">',
             '<rect width="620" height="320" fill="#fff"/>',
             '<path d="M60 30V270H580" fill="none" stroke="#333"/>']  # fmt: skip
    for value in (-800, -600, -400, -200, 0):
        y = 270 - 240 * (value - low[1]) / (high[1] - low[1])
        lines.append(f'<text x="52" y="{y + 4:.0f}" text-anchor="end">{value}</text>')
    for part in range(5):
        lines.append(f'<text x="{60 + 130 * part}" y="288" text-anchor="middle">'
                     f"{longest * part / 4e6:.2f}</text>")  # fmt: skip
    lines.append('<text x="320" y="308" text-anchor="middle">actions of training [million]</text>')
    lines.append('<text x="60" y="20">mean return in 300 goals</text>')
    for experiment, points in curves:
        lines.append(f'<polyline points="{polyline(points, low, high)}" fill="none" '
                     f'stroke="{colours[experiment.name]}" stroke-width="1.2"/>')  # fmt: skip
    shown = [e for e in EXPERIMENTS if any(c[0] is e for c in curves)]
    for place, experiment in enumerate(shown):
        lines.append(f'<text x="440" y="{200 + 16 * place}" fill="{colours[experiment.name]}">'
                     f"{experiment.row}</text>")  # fmt: skip
    return "\n".join([*lines, "</svg>"]) + "\n"


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--write", action="store_true", help="into learning/README.md")
    args = parser.parse_args()
    if not args.write:
        print(tables(), end="")
        return
    page = PAGE.read_text()
    if page.count(BEGIN) != 1 or page.count(END) != 1:
        raise SystemExit(f"{PAGE}: expected one line {BEGIN.strip()!r} and one {END.strip()!r}")
    before, after = page.split(BEGIN)[0], page.split(END)[1]
    PAGE.write_text(before + BEGIN + tables() + END + after)
    drawn = figure()
    if drawn:
        FIGURE.write_text(drawn)


if __name__ == "__main__":
    main()
