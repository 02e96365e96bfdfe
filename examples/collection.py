# SPDX-License-Identifier: Apache-2.0
"""One collection of many kinds of touch: the paper's five tasks, an egg in a hand, meshes and gels.

    PYTHONPATH=build/release/python python examples/collection.py out/touch --episodes 10000

It makes a data set in OUT/NAME for each part of the list below, then OUT/README.md, the card. The
scenes and meshes that the sets name lie in OUT, so OUT may be moved or copied as a whole. Run
the same command again after a stop: complete shards stay. Processes of a scheduler share the work.
`--to lerobot` also exports each part into OUT/NAME_lerobot.

The scenes of the meshes and of the gels are those that come with the program. Here bodies start at
random places, mass, friction and stiffness vary, skins have flaws, and cameras see them.
"""

from __future__ import annotations

import argparse
import os
import re
import sys
import time
from dataclasses import dataclass
from pathlib import Path

import tangere
from tangere._generate import run_command
from tangere.data import Episodes
from tangere.export import export


@dataclass
class Part:
    """A data set of the collection. share: of the episodes, in hundredths."""

    name: str
    what: str
    share: int
    options: tuple[str, ...] = ()


WIDER = ("--noise", "0.1", "--mix", "random=0.2")  # what a script alone would not show
PARTS = (
    Part("ball_rolling", "ball_rolling_small", 8, ("--policy", "random")),
    Part("stable_grasp", "stable_grasp", 24, ("--mix", "random=0.2")),
    Part("box_pushing", "box_pushing", 24, WIDER),
    Part("cap_opening", "cap_opening", 6, WIDER),
    Part("insertion", "insertion", 10, ("--mix", "random=0.2")),
    Part("in_hand", "in_hand", 4, ("--mix", "random=0.2")),
    *(Part(f"touch_{mesh}", f"touch_{mesh}.xml", 6,
           ("--steps", "200", "--every", "2", "--record", "q,v,left_finger,right_finger,eye.rgb"))
      for mesh in ("mug", "pebble")),
    *(Part(f"touch_gel_{kind}", f"touch_gel_{kind}.xml", 4,
           ("--steps", "300", "--every", "10", "--record", "q,v,gel,gel.markers,gel.rgb_marker"))
      for kind in ("soft", "usual", "hard")),
)  # fmt: skip

# Meshes that two skins with flaws grip and lift at random places, seen by a camera.
MESHES = {"mug": "mug.obj", "pebble": "pebble.obj"}
MUG = (
    ('filename="meshes/mug.obj"', 'filename="meshes/{mesh}"'),
    ('axis0="1 0 0" axis1="0 0 1" resolution="24 24"/>',
     'axis0="1 0 0" axis1="0 0 1" resolution="24 24">{flaws}</tactile>'),
    ('axis0="0 0 1" axis1="1 0 0" resolution="24 24"/>',
     'axis0="0 0 1" axis1="1 0 0" resolution="24 24">{flaws}</tactile>'),
    ("</sensor>",
     '<camera name="eye" pos="0.12 -0.12 0.12" look="0 0 0.03" rows="64" cols="64"/></sensor>'),
    ("</tangere>", """  <randomize>
    <body name="mug" field="density" uniform="400 1200"/>
    <joint name="mug" q="0" uniform="-0.004 0.004"/>
    <joint name="mug" q="1" uniform="-0.002 0.002"/>
    <joint name="hand" q="0" uniform="-0.008 0.004"/>
    <general_primitive_contact general_body="left_finger" primitive_body="mug" field="mu"
                               uniform="0.4 1.2" tie="mu"/>
    <general_primitive_contact general_body="right_finger" primitive_body="mug" field="mu"
                               uniform="0.4 1.2" tie="mu"/>
    <tactile name="left_finger" field="mu" uniform="0.4 1.2" tie="mu"/>
    <tactile name="right_finger" field="mu" uniform="0.4 1.2" tie="mu"/>
    <tactile name="left_finger" field="kn" log_uniform="60 160" tie="kn"/>
    <tactile name="right_finger" field="kn" log_uniform="60 160" tie="kn"/>
  </randomize>
</tangere>"""),
)  # fmt: skip
FLAWS = '<imperfections noise="0.002 0.001" bias="0.001" gain="0.05" dead="0.01"/>'

# Gels with a camera and printed markers, of three moduli and thicknesses. They press and roll balls
# whose mass, friction and place vary.
GEL = (
    ('kn="2.5e8"', 'kn="{kn}"'),
    ('modulus="4.28e5" thickness="4e-3"', 'modulus="{modulus}" thickness="{thickness}"'),
    ('<layer cell="0.75e-3" margin="1e-3"/>',
     '<layer cell="0.75e-3" margin="1e-3"/><markers/>'
     '<picture rows="60" cols="80" markers="9 7" noise="1.5" gain="0.03"/>'),
    ('<tactile name="gel" field="kn" uniform="2e8 3e8"/>',
     """<body name="ball" field="density" uniform="1000 4000"/>
    <ground_contact body="ball" field="mu" uniform="0.4 1"/>
    <joint name="ball" q="0" uniform="-0.002 0.002"/>
    <joint name="ball" q="1" uniform="-0.003 0.003"/>"""),
)  # fmt: skip
# Modulus [Pa], thickness [m], and what the plate resists with [N/m^3], as modulus / thickness.
GELS = {
    "soft": ("2e5", "4e-3", "1.2e8"),
    "usual": ("4.28e5", "4e-3", "2.5e8"),
    "hard": ("8e5", "2.5e-3", "7.5e8"),
}


def changed(scene: str, pairs: tuple[tuple[str, str], ...], **words: str) -> str:
    """The text of a scene that comes with the program, with other words in some places."""
    text = tangere.scenes()[scene].read_text()
    for old, new in pairs:
        if old not in text:
            raise tangere.InputError(f"{scene}: no {old!r}; expected the scene of this version")
        text = text.replace(old, new.format(**words) if words else new, 1)
    return text


def scene_of_mesh(kind: str) -> str:
    """The scene of the mug with another mesh, whose body has the name of what it is."""
    text = changed("mug", MUG, mesh=MESHES[kind], flaws=FLAWS).replace('"mug"', f'"{kind}"')
    comment = f"""<!-- SPDX-License-Identifier: Apache-2.0
     Two fingers with flawed skins grip a {kind} at a random place, lift it and hold it. A camera
     sees it. The scene is mug.xml of Tangere, changed by examples/collection.py. -->"""
    return re.sub("<!--.*?-->", comment, text, count=1, flags=re.DOTALL)


def write_scenes(folder: Path) -> None:
    """The scenes that are changed, and the meshes that they name, beside the data sets."""
    meshes = tangere.scenes()["mug"].parent / "meshes"
    scenes = {f"meshes/{mesh}": (meshes / mesh).read_text() for mesh in MESHES.values()}
    scenes |= {f"touch_{kind}.xml": scene_of_mesh(kind) for kind in MESHES}
    (folder / "meshes").mkdir(exist_ok=True)
    for kind, (modulus, thickness, kn) in GELS.items():
        words = {"modulus": modulus, "thickness": thickness, "kn": kn}
        scenes[f"touch_gel_{kind}.xml"] = changed("gel_press", GEL, **words)
    for name, text in scenes.items():
        path = folder / name
        if not path.is_file():
            part = folder / f"{name}.{os.getpid()}.part"
            part.write_text(text)
            part.rename(path)


def shared(episodes: int) -> list[int]:
    """Episodes of each part, one or more: as its share says, and `episodes` together. There are at
    least as many as parts."""
    exact = [episodes * part.share / 100 for part in PARTS]
    counts = [max(1, int(share)) for share in exact]
    while sum(counts) != episodes:
        step = 1 if sum(counts) < episodes else -1
        free = [k for k, count in enumerate(counts) if count + step >= 1]
        k = max(free, key=lambda k: step * (exact[k] - counts[k]))
        counts[k] += step
    return counts


def make(folder: Path, episodes: int, seed: int) -> None:
    """Makes what is missing of all parts."""
    folder.mkdir(parents=True, exist_ok=True)
    write_scenes(folder)
    for part, count in zip(PARTS, shared(episodes), strict=True):
        start = time.monotonic()
        done = run_command([
            "generate", part.what, "--output", part.name, "--episodes", str(count),
            "--seed", str(seed), "--compress", "deflate", "--resume", "--quiet", *part.options,
        ], folder=folder)  # fmt: skip
        print(f"{part.name}: {count} episodes, {done['bytes'] / 1e6:.1f} MB, "
              f"{time.monotonic() - start:.1f} s", flush=True)  # fmt: skip


def card(folder: Path, license: str) -> str:
    """What is in the collection, how it was made, and the bits that it should have."""
    sets = {part.name: Episodes(folder / part.name) for part in PARTS}
    first = next(iter(sets.values())).attributes
    lines = [
        "# Touch of many kinds",
        "",
        f"Simulated by Tangere {first['tangere_version']}, instruction set "
        f"{first['instruction_set']}. Licence: {license}. Numbers are in SI units.",
        "",
        "| data set | episodes | rows | solved | observations | checksum |",
        "|---|---|---|---|---|---|",
    ]
    for name, data in sets.items():
        solved = str(len(data.succeeded())) if data.task else "-"
        shown = ", ".join(key for key in data.keys if key not in data.privileged)
        lines.append(f"| {name} | {len(data)} | {int(data.lengths.sum())} | {solved} | {shown} | "
                     f"{data.content:016x} |")  # fmt: skip
    lines += ["", "## What varies", ""]
    for name, data in sets.items():
        numbers = (
            ", ".join(map(str, data.attributes.get("randomized_names", []))) or "starts, goals"
        )
        lines.append(f"- {name}: {numbers}")
    lines += ["", "## How it was made", "", "In this folder, which has the scenes and meshes:", ""]
    lines += [f"    {data.command}" for data in sets.values()]
    lines += [
        "",
        "The checksum covers every action and observation. The same command gives the same one on "
        "the same instruction set. `tangere validate` compares it with the numbers.",
    ]
    return "\n".join(lines) + "\n"


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("output", type=Path)
    parser.add_argument("--episodes", type=int, default=10000, help="of all parts together")
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--license", default="CC0-1.0", help="of the data, as the card names it")
    parser.add_argument("--to", choices=["lerobot", "zarr"], help="also export each part")
    args = parser.parse_args()
    if args.episodes < len(PARTS):
        parser.error(f"--episodes {args.episodes}; expected {len(PARTS)} or more, one of each part")
    try:
        return write(args)
    except (OSError, tangere.InputError, tangere.IoError) as error:
        print(f"collection.py: {error}", file=sys.stderr)
        return 2 if isinstance(error, tangere.InputError) else 3


def write(args: argparse.Namespace) -> int:
    """Makes the parts, the card and the exports; returns the exit code."""
    make(args.output, args.episodes, args.seed)
    merged = [(args.output / part.name / "robomimic.hdf5").is_file() for part in PARTS]
    if not all(merged):
        print("other processes still make shards; the last one writes the card")
        return 0
    path = args.output / "README.md"
    part = args.output / f"README.md.{os.getpid()}.part"
    part.write_text(card(args.output, args.license))
    part.rename(path)
    for one in PARTS if args.to else ():
        done = export(args.output / one.name, args.output / f"{one.name}_{args.to}", args.to,
                      resume=True)  # fmt: skip
        print(f"{done.output}: {done.frames} frames")
    return 0


if __name__ == "__main__":
    sys.exit(main())
