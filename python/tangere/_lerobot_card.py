# SPDX-License-Identifier: Apache-2.0
"""README.md of a LeRobot data set: what is in it, and where `datasets.load_dataset` finds it."""

from __future__ import annotations

import json
from typing import Any, Sequence

from ._export_frames import (
    Frames, action_unit, hidden_in_words, names_of, number_units, unit_and_meaning, unit_text
)  # fmt: skip
from ._lerobot_features import STATE, Feature
from .data import Episodes


def card(
    frames: Frames, features: Sequence[Feature], info: dict[str, Any], text: str,
    successes: int, license: str,
) -> str:  # fmt: skip
    """The text of the file. `info` is that of meta/info.json."""
    episodes = frames.episodes
    said = episodes.attributes
    title = episodes.task or str(said["name"])
    tags = ["LeRobot", "tangere", "tactile", "simulation", title]
    solved = f" Success ends {successes} of them." if episodes.task else ""
    lines = [
        "---",
        f"license: {json.dumps(license)}",
        "task_categories: [robotics]",
        f"tags: {json.dumps(tags, ensure_ascii=False)}",
        "configs:",
        "- config_name: default",
        "  data_files: data/*/*.parquet",
        "---",
        f"# {title}",
        "",
        f"{text}. Simulated by Tangere, written as LeRobotDataset {info['codebase_version']}.",
        "",
        f"- {info['total_episodes']} episodes with {info['total_frames']} frames.{solved}",
        f"- A frame is one action, which lasts {frames.seconds:g} s. Time stamps are multiples "
        f"of 1/{info['fps']} s. A step of the simulation takes {float(said['timestep']):g} s.",
        *_windows(frames),
        f"- Numbers are float32 in SI units. Pictures are {_pictures(features)}.",
        "",
        "## Columns",
        "",
        *_columns(episodes, features),
        *_left_out(frames, features),
    ]
    if episodes.sensors:
        lines += ["", "## Sensors", "", *_sensors(episodes)]
    lines += [
        "",
        "## Origin",
        "",
        f"- Command: `{episodes.command}`",
        f"- Tangere {said['tangere_version']}, instruction set {said['instruction_set']}",
        "- `meta/tangere.json` has the demo of each episode, scales of observations, and how each "
        "column is made.",
    ]
    return "\n".join(lines) + "\n"


def _windows(frames: Frames) -> list[str]:
    kinds: dict[tuple[float, float], list[str]] = {}
    for key, window in frames.windows.items():
        kinds.setdefault((window["readings"], window["seconds"]), []).append(f"`{key}`")
    return [
        f"- {', '.join(keys)}: {readings:g} samples a frame along the first axis, {seconds:g} s "
        "apart, the last one at the time of the frame. Before an episode begins they repeat its "
        "first sample."
        for (readings, seconds), keys in kinds.items()
    ]


def _pictures(features: Sequence[Feature]) -> str:
    return "video, AV1" if any(feature.is_video for feature in features) else "PNG"


def _columns(episodes: Episodes, features: Sequence[Feature]) -> list[str]:
    said = episodes.attributes
    unit = f" [{action_unit(episodes)}]" if action_unit(episodes) else ""
    about = {
        "action": f"{said.get('action_meaning', 'controls')}{unit}",
        "next.reward": "reward of the action",
        "next.done": "true in the last frame of an episode",
        "next.success": "true in the last frame of an episode that ended in success",
    }
    lines = []
    for feature in features:
        lines.append(
            f"- `{feature.name}`, {tuple(feature.shape)} {feature.dtype}"
            + (f": {about[feature.name]}" if feature.name in about else "")
        )
        for key in feature.keys if feature.name not in about else []:
            what = f"`{key}`"
            if key in feature.blocks:
                mean = any(name.startswith(f"{key}.mean") for name in feature.names or [])
                block = f"over blocks of {feature.blocks[key]} points along each side"
                what += f", means {'over each pad' if mean else block}"
            if feature.is_picture and feature.range:
                ranges = ", ".join(f"{x:g}" for x in feature.range)
                what += f", pad {feature.pad}: 0, 128 and 255 are -range, 0 and range, ({ranges})"
            if key in feature.numbers:
                moved = "with a motor" if feature.name == STATE else "without a motor"
                names = names_of(episodes, key, feature.numbers[key])
                what += f" of joints {moved}: {', '.join(names)}"
            unit, meaning = unit_and_meaning(episodes, key)
            if key in ("q", "v"):
                unit = unit_text(number_units(episodes, key, 1, feature.numbers.get(key, ())))
            what += f" [{unit}]" if unit else ""
            lines.append(f"  - {what}" + (f": {meaning}" if meaning else ""))
    return lines


def _left_out(frames: Frames, features: Sequence[Feature]) -> list[str]:
    written = {key for feature in features if feature.name != STATE for key in feature.keys}
    hidden = hidden_in_words(frames, written)
    return ["", f"Left out, because a robot could not measure them: {hidden}."] if hidden else []


def _sensors(episodes: Episodes) -> list[str]:
    lines = []
    for name, about in episodes.sensors.items():
        size = about.get("resolution")
        grid = f"{int(size[0])} × {int(size[1])} points" if size is not None else "a list of points"
        corners = ""
        if "corner0" in about:
            ends = (", ".join(f"{x:g}" for x in about[c]) for c in ("corner0", "corner1"))
            corners = " from ({}) to ({}) m".format(*ends)
        lines.append(
            f"- `{name}` on body `{about['body']}`: {grid}{corners}; components "
            f"{about['components']} [{about['units']}]; in the frame {about['frame']}"
        )
    return lines
