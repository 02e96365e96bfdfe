# SPDX-License-Identifier: Apache-2.0
"""Which robots in a folder import, what the others lack, and whether they move as in MuJoCo.

    python3 bench/robots_of_others.py FOLDER [--skip NAME] [--json out.json] [--gallery out/hands]

Every URDF and MJCF file below FOLDER is imported by `tangere import --drop`, and its scene takes 20
steps. What has no joint that moves is imported with `--base free`, and takes no steps if it has no
mass either. No file is changed. The table has files that import whole, those that import with
something left out, those of both that stand still, those that are refused, and those whose scenes
stop; then it counts each reason and names a file that has it. Where the modules
`mujoco` and `tangere` are there, MuJoCo reads each file too (robots_in_mujoco.py): files that it
refuses as well are counted apart, and masses and accelerations are compared.

`--gallery` makes a folder with a drawing of every robot that imports whole, and a page that shows
them all: index.html. The drawings stay on your machine; what robots look like belongs to their
makers.

    python3 -m venv out/venv && out/venv/bin/pip install mujoco==4.0.0 gymnasium==1.4.0
    PYTHONPATH=build/release/python out/venv/bin/python bench/robots_of_others.py FOLDER
"""

import argparse
import html
import json
import re
import subprocess
import sys
import tempfile
import xml.etree.ElementTree as tree
from collections import Counter
from collections.abc import Callable
from pathlib import Path

ROOT = Path(__file__).resolve().parent.parent
KINDS = ("whole", "dropped", "refused", "by both", "stopped", "crashed")
try:
    import robots_in_mujoco as peer
except ImportError as missing:
    print(f"no comparison with MuJoCo: {missing}", file=sys.stderr)
    peer = None


def is_robot(path: Path) -> bool:
    """Whether a file is one of URDF, or its root that of MJCF."""
    if path.suffix.lower() == ".urdf":
        return True
    try:
        for _, element in tree.iterparse(path, events=["start"]):
            return element.tag == "mujoco"
    except (tree.ParseError, UnicodeDecodeError):
        pass
    return False


def call(tangere: Path, *words: object) -> tuple[int, dict]:
    """Runs the command and returns its exit code and its JSON object."""
    try:
        done = subprocess.run(
            [tangere, *map(str, words), "--json"], capture_output=True, text=True, timeout=300
        )
    except subprocess.TimeoutExpired:
        return 124, {"error": "more than 300 s"}
    try:
        return done.returncode, json.loads(done.stdout)
    except json.JSONDecodeError:
        return done.returncode, {"error": done.stderr[-300:]}


def tried(path: Path, tangere: Path, folder: Path, drawing: Path | None = None) -> dict:
    """Imports a robot and steps its scene. Returns what became of it. `drawing`: the file for the
    picture of a robot that imports whole; none: no picture."""
    scene = folder / "robot.xml"
    words = ["import", path, "-o", scene, "--drop", "--overwrite"]
    code, result = call(tangere, *words)
    still, free = code == 0 and result["joints"] == 0, False
    if still:
        _, other = call(tangere, *words, "--base", "free")
        free = other.get("joints", 0) > 0
        if free:
            result, still = other, False
    out = {"file": str(path), "lost": result.get("lost", []), "still": still}
    if code != 0:
        both = peer is not None and peer.refusal(path) != ""
        kind = "crashed" if code not in (2, 3) else "by both" if both else "refused"
        return out | {"result": kind, "reason": result.get("error", "")}
    out["result"] = "dropped" if out["lost"] else "whole"
    if drawing and out["result"] == "whole" and not still:
        code, told = call(tangere, "plot", scene, "-o", drawing, "--overwrite")
        if code == 0:
            out |= {"drawing": drawing.name, "joints": result["joints"], "motors": result["motors"]}
        else:
            print(f"{path}: no drawing: {told.get('error', told)}", file=sys.stderr)
    if still:
        return out
    code, result = call(
        tangere, "simulate", scene, "-o", folder / "run.h5", "--steps", 20, "--overwrite"
    )
    if code != 0:
        return out | {"result": "stopped", "reason": str(result.get("error", result))}
    if peer and not free:
        out["peer"] = peer.compare(path, scene.read_text(), str(scene))
    return out


def shape_of(reason: str) -> str:
    """Returns a reason without places, names and numbers, so that equal ones can be counted."""
    text = re.sub(r"^.*?\.(urdf|xml)(:\d+)?: ", "", reason.split("\n")[0], flags=re.I)
    text = re.sub(r" \(lines? [^)]*\)$", "", text)
    text = re.sub(r"(/?[\w.@+-]*/)+[\w.@+ -]+", "FILE", text)
    text = re.sub(r"'[^']*'|\"[^\"]*\"", "'X'", text)
    return re.sub(r"-?\d+\.?\d*(e[-+]?\d+)?", "N", text)[:150]


def print_counts(title: str, rows: list[dict], reasons: Callable[[dict], list[str]]) -> None:
    counts: Counter[str] = Counter()
    example: dict[str, str] = {}
    for row in rows:
        for reason in {shape_of(r) for r in reasons(row)}:
            counts[reason] += 1
            example.setdefault(reason, Path(row["file"]).name)
    if counts:
        print(f"\n{title}")
    for reason, count in counts.most_common():
        print(f"{count:5}  {reason}  [{example[reason]}]")


def print_table(folder: Path, rows: list[dict]) -> None:
    print(f"{'':26} files" + "".join(f"{k:>9}" for k in KINDS) + "    still     same")
    groups = sorted({Path(r["file"]).relative_to(folder).parts[0] for r in rows})
    for group in [*groups, ""]:
        mine = [r for r in rows if Path(r["file"]).is_relative_to(folder / group)]
        counts = Counter(r["result"] for r in mine)
        same = sum(r.get("peer") == ["the same"] for r in mine)
        numbers = "".join(f"{counts[k]:9}" for k in KINDS)
        still = sum(r["still"] for r in mine)
        print(f"{group or 'all':26} {len(mine):5}{numbers}{still:9}{same:9}")
    for kind in KINDS[2:]:
        some = [r for r in rows if r["result"] == kind]
        print_counts(f"{kind}:", some, lambda r: [r["reason"]])
    print_counts("left out with --drop:", rows, lambda r: r["lost"])
    print_counts("beside MuJoCo:", [r for r in rows if "peer" in r], lambda r: r["peer"])


def write_gallery(folder: Path, gallery: Path, rows: list[dict]) -> None:
    """Writes index.html beside the drawings."""
    drawn = [r for r in rows if "drawing" in r]
    figures = "\n".join(
        f'<figure><img src="{r["drawing"]}" alt="" loading="lazy"><figcaption>'
        f"{html.escape(str(Path(r['file']).relative_to(folder)))}<br>"
        f"{r['joints']} joints, {r['motors']} motors</figcaption></figure>"
        for r in drawn
    )
    style = (
        "body{font-family:sans-serif;display:flex;flex-wrap:wrap;gap:1em}"
        "figure{width:18em;margin:0;overflow-wrap:anywhere}img{width:100%}"
    )
    (gallery / "index.html").write_text(
        f'<!doctype html><meta charset="utf-8"><title>{len(drawn)} robots that import whole'
        f"</title><style>{style}</style>\n{figures}\n"
    )
    print(f"{len(drawn)} drawings: {gallery / 'index.html'}")


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.split("\n")[0])
    parser.add_argument("folder", type=Path)
    parser.add_argument("--tangere", type=Path, default=ROOT / "build/release/tangere")
    parser.add_argument("--skip", default="", help="leave out paths that have this in them")
    parser.add_argument("--json", type=Path, help="write what became of each file")
    parser.add_argument("--gallery", type=Path, help="a folder for drawings and a page of them")
    given = parser.parse_args()
    files = [
        path
        for path in sorted(given.folder.rglob("*"))
        if path.suffix.lower() in (".urdf", ".xml", ".mjcf")
        and path.is_file()
        and not (given.skip and given.skip in str(path))
        and is_robot(path)
    ]
    if given.gallery:
        given.gallery.mkdir(parents=True, exist_ok=True)
    with tempfile.TemporaryDirectory() as name:
        rows = [
            tried(path, given.tangere, Path(name),
                  given.gallery and given.gallery / f"robot_{k:04}.svg")
            for k, path in enumerate(files)
        ]  # fmt: skip
    if given.json:
        given.json.write_text(json.dumps(rows, indent=1))
    print_table(given.folder, rows)
    if given.gallery:
        write_gallery(given.folder, given.gallery, rows)


if __name__ == "__main__":
    main()
