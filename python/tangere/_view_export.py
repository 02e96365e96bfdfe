# SPDX-License-Identifier: Apache-2.0
"""Pages of exports: what `tangere view` does with what `tangere export` has written.

The frames of some episodes become a small data set of Tangere in a folder of its own, of which
`tangere view` makes the page. Where the bodies are is known if the export has q. Else they stay
where the first episode of the data set began, and the page says so.
"""

from __future__ import annotations

import argparse
import io
import json
import os
import re
import sys
import tempfile
from pathlib import Path
from typing import Any, Callable, Iterable, NamedTuple, Sequence

import h5py
import numpy as np

from . import _core
from ._generate import run_command

Arrays = dict[str, np.ndarray]

class _Export(NamedTuple):
    command: str  # of the data set
    note: dict[str, Any]  # what the exporter has left for pages
    seconds: float  # of a frame
    lengths: list[int]
    read: Callable[[int], Arrays]  # episode → KEY → (frames, …), with "q" and "rewards"


def page(
    path: str | Path, *, episode: int | None = None, episodes: int = 16, frames: int = 1000,
    scene: str = "",
) -> tuple[str, dict[str, Any]]:  # fmt: skip
    """The page of an export, and what the command says of it.

    Raises InputError for another folder, an export without the scene, and an episode that it does
    not have.
    """
    path = Path(path)
    _core.check_export(path)
    export = _open(path)
    count = len(export.lengths)
    if episode is not None and not 0 <= episode < count:
        raise _core.InputError(f"{path} has no episode {episode}; it has 0 to {count - 1}")
    chosen = range(min(episodes, count)) if episode is None else [episode]
    with tempfile.TemporaryDirectory() as folder:
        data, out = Path(folder) / "export.h5", Path(folder) / "page.html"
        moved = _write(data, path, export, chosen)
        words = ["view", str(data), "-o", str(out), "--frames", str(frames)]
        scene = scene or _scene_beside(path, export)
        words += ["--episodes", str(len(chosen)), *(["--scene", scene] if scene else [])]
        said = run_command(words)
        text = out.read_text(encoding="utf-8").replace(json.dumps(str(data)), json.dumps(str(path)))
    said["notes"] = _notes(export, moved, count, len(chosen), episode) + said["notes"]
    old, new = (re.compile(r'"notes":\s*\[[^\]]*\]'), json.dumps(said["notes"]))
    text = old.sub(lambda _: f'"notes":{new}', text, count=1)
    return text, said | {"input": str(path), "bytes": len(text.encode())}


def _scene_beside(path: Path, export: _Export) -> str:
    """The file of the scene that lies in the export or beside it, as the command names it; none if
    there is none with the same text. Its meshes are then beside it, wherever the folder was moved.
    """
    named = re.match("tangere generate (.*?) --episodes ", export.command)
    if named is None:
        return ""
    for folder in (path, path.absolute().parent):
        file = folder / Path(named[1]).name
        try:
            if file.is_file() and file.read_text(encoding="utf-8") == export.note["text"]:
                return str(file)
        except ValueError:  # no text
            pass
    return ""


def _notes(
    export: _Export, moved: bool, count: int, shown: int, episode: int | None
) -> list[str]:
    notes = []
    if not moved:
        notes.append(
            "The export has no q (--privileged): bodies stay where the first episode began."
        )
    if shown < count and episode is None:
        notes.append(f"The first {shown} of {count} episodes.")
    return notes


def _open(path: Path) -> _Export:
    name = next((name for name in _ORIGINS if (path / name).is_file()), None)
    if name is None:
        raise _core.InputError(f"{path} is no export of `tangere export`")
    try:
        said = json.loads((path / name).read_text(encoding="utf-8"))
    except ValueError as error:
        raise _core.IoError(f"{path / name} is damaged: {error}") from None
    if "scene" not in said:
        raise _core.InputError(
            f"{path} has no scene in {name}; expected an export of a data set with q by this "
            "version"
        )
    try:
        return _ORIGINS[name](path, said)
    except ModuleNotFoundError:
        raise
    except Exception as error:  # whatever the library of the format raises for damaged bytes
        raise _core.IoError(f"'{path}' is damaged: {error!r}") from error


def _zarr(path: Path, said: dict[str, Any]) -> _Export:
    import zarr

    root = zarr.open_group(str(path), mode="r", zarr_format=2)
    ends = np.asarray(root["meta/episode_ends"])
    starts = np.concatenate([[0], ends])
    ftp1 = {
        f"{side}_tactile_data_{re.sub(r'[^a-zA-Z0-9_]', '_', key)}": key
        for key in said["scene"]["sensors"]
        for side in ("left", "right")
    }
    data: Any = root["data"]
    arrays: dict[str, Any] = dict(data.arrays())

    def read(episode: int) -> Arrays:
        part = slice(starts[episode], ends[episode])
        found: Arrays = {}
        for name, array in arrays.items():
            key = str(ftp1.get(name, name))
            if not _is_wanted(key, said["scene"]) and name != "reward":
                continue
            rows = np.asarray(array[part])
            rows = rows[:, 0] if name in ftp1 else rows  # the one pad
            if "window" in array.attrs and name in ftp1:
                rows = rows[..., -(rows.shape[-1] // array.attrs["window"]["readings"]) :]
            elif "window" in array.attrs:
                rows = rows[:, -1]
            found["rewards" if name == "reward" else key] = rows
        whole = [
            (arrays[key].attrs["names"], found.pop(key))
            for key in ("q", "q_privileged")
            if key in found
        ]
        found |= _coordinates(whole, said["scene"]["q_names"])
        return found

    return _Export(
        said["command"], said["scene"], float(said["seconds_per_frame"]), np.diff(starts).tolist(),
        read,
    )  # fmt: skip


def _univtac(path: Path, said: dict[str, Any]) -> _Export:
    def read(episode: int) -> Arrays:
        found: Arrays = {}
        with h5py.File(path / f"hdf5/{episode}.hdf5") as file:
            if "q" in file:
                found["q"] = file["q"][()]
            elif said["joints"] == said["scene"]["q_names"]:
                found["q"] = file["embodiment/joint"][()]
            found["rewards"] = file["reward"][()]
            for key in said["scene"]["sensors"]:
                if f"tactile/{key}/force" in file:
                    found[key] = file[f"tactile/{key}/force"][()]
            for name in said["datasets"]:
                kind, *rest = name.split("/")
                if kind in ("tactile", "observation") and rest[-1] in ("rgb", "rgb_marker"):
                    files = file[name][()].tolist()
                    found[".".join(rest)] = _core.decode_jpeg(files, name)[..., ::-1]
        return found

    lengths = [int(episode["steps"]) for episode in said["episodes"]]
    return _Export(said["command"], said["scene"], float(said["seconds_per_frame"]), lengths, read)


def _lerobot(path: Path, said: dict[str, Any]) -> _Export:
    import pyarrow.dataset as files

    table = files.dataset(path / "data", format="parquet")
    names = table.schema.names
    features = json.loads((path / "meta/info.json").read_text(encoding="utf-8"))["features"]
    index = table.to_table(columns=["episode_index"])["episode_index"].to_numpy()
    place, images = said["scene"]["q_names"], "observation.images."

    def read(episode: int) -> Arrays:
        wanted = {
            name: name.removeprefix("observation.")
            for name in names
            if name.removeprefix("observation.") in said["scene"]["sensors"]
        }
        vectors = [c for c in said["columns"] if {*place} & {*(c.get("names") or ())}]
        pictures = [name for name in names if name.startswith(images)]
        columns = [*wanted, *(c["name"] for c in vectors), *pictures, "next.reward"]
        rows = table.to_table(columns=columns, filter=files.field("episode_index") == episode)
        found = {"rewards": _numbers(rows["next.reward"], ())}
        for name, key in wanted.items():
            array = _numbers(rows[name], features[name]["shape"])
            found[key] = array[:, -1] if key in said.get("windows", {}) else array
        whole = [(c["names"], _numbers(rows[c["name"]], c["shape"])) for c in vectors]
        found |= _coordinates(whole, place)
        for name in pictures:
            found[name.removeprefix(images)] = _unpacked(rows[name].to_pylist())
        return found

    lengths = np.bincount(index).tolist()
    return _Export(
        said["command"], said["scene"], float(said["seconds_per_action"]), lengths, read
    )  # fmt: skip


_ORIGINS = {"meta/tangere.json": _lerobot, ".zattrs": _zarr, "metadata.json": _univtac}


def _coordinates(
    parts: Sequence[tuple[Sequence[str], np.ndarray]], q_names: Sequence[str]
) -> Arrays:
    """q, if its numbers are in arrays (frames, names)."""
    known = {name: rows[:, k] for names, rows in parts for k, name in enumerate(names)}
    if not {*q_names} <= {*known}:
        return {}
    return {"q": np.stack([known[name] for name in q_names], axis=1)}


def _numbers(column: Any, shape: Sequence[int]) -> np.ndarray:
    """(rows, *shape) of lists in lists."""
    from pyarrow.types import is_nested

    values = column.combine_chunks()
    while is_nested(values.type):
        values = values.flatten()
    return values.to_numpy(zero_copy_only=False).reshape(len(column), *shape)


def _unpacked(files: Iterable[dict[str, bytes]]) -> np.ndarray:
    from PIL import Image

    return np.stack([np.asarray(Image.open(io.BytesIO(file["bytes"]))) for file in files])


def _is_wanted(key: str, note: dict[str, Any]) -> bool:
    known = {"q", "q_privileged", *note["sensors"]}
    return key in known or key.endswith((".rgb", ".rgb_marker"))


def _read(path: Path, export: _Export, episode: int) -> Arrays:
    try:
        return export.read(episode)
    except (ModuleNotFoundError, _core.IoError):
        raise
    except Exception as error:  # whatever the library of the format raises for damaged bytes
        raise _core.IoError(
            f"'{path}' is damaged: episode {episode} cannot be read: {error}; `tangere validate` "
            "names the file"
        ) from error


def _write(data: Path, path: Path, export: _Export, chosen: Sequence[int]) -> bool:
    """Writes the data set. Returns whether the bodies move."""
    note, sensors, moved = export.note, export.note["sensors"], False
    with h5py.File(data, "w") as file:
        scene = file.create_group("scene")
        longest = max(export.lengths[k] for k in chosen)
        scene.attrs.update({
            "name": note["name"], "text": note["text"], "q_names": note["q_names"],
            "timestep": export.seconds, "every": 1, "steps": longest, "policy": "of the export",
        })  # fmt: skip
        if "included" in note:
            scene.attrs["included"] = note["included"]
        file.attrs.update({
            "format": "tangere dataset", "format_version": 6, "dataset_episodes": len(chosen),
            "dataset_shards": 1, "command": export.command,
        })  # fmt: skip
        file.create_group("failed")
        if note.get("randomized_names"):
            scene.attrs["randomized_names"] = note["randomized_names"]
        stored: list[str] = []
        for k in chosen:
            arrays = _read(path, export, k)
            rewards = arrays.pop("rewards")
            moved = moved or "q" in arrays
            arrays.setdefault("q", np.tile(np.float64(note["q_start"]), (len(rewards), 1)))
            demo = file.create_group(f"data/demo_{k}")
            demo.attrs["num_samples"] = len(rewards)
            if note.get("randomized_names"):
                demo.attrs["randomized"] = np.float64(note["randomized"][k])
            demo["rewards"] = rewards
            for key, rows in arrays.items():
                if key in sensors and rows[0].size != 3 * sensors[key]["points"]:
                    continue  # an observation of a task that has the name of a sensor
                demo[f"obs/{key}"], demo[f"final_obs/{key}"] = rows, rows[-1:]
                stored += [] if key in stored else [key]
        scene.attrs["observations"] = stored
        scene.create_group("sensors")
        for name, about in sensors.items():
            group = scene.create_group(f"sensors/{name}")
            group.attrs["pressure_sign"] = about["pressure_sign"]
            group.attrs["readings"] = [name]
    return moved


def main(arguments: Sequence[str] | None = None, prog: str = "tangere view") -> int:
    """`tangere view EXPORT`; returns its exit code, as the command has them."""
    parser = argparse.ArgumentParser(prog=prog, allow_abbrev=False)
    parser.add_argument("input")
    parser.add_argument("--output", required=True)
    parser.add_argument("--episode", type=int)
    parser.add_argument("--episodes", type=int, default=16)
    parser.add_argument("--frames", type=int, default=1000)
    parser.add_argument("--scene", default="")
    for flag in ("--overwrite", "--quiet", "--json"):
        parser.add_argument(flag, action="store_true")
    given = parser.parse_args(arguments)

    def fail(code: int, text: str) -> int:
        if given.json:
            print(json.dumps({"command": "view", "exit_code": code, "error": text}))
        else:
            print(f"tangere: {text}", file=sys.stderr)
        return code

    out = Path(given.output)
    if out.exists() and not given.overwrite:
        return fail(3, f"'{out}' exists already; expected another name, or --overwrite")
    try:
        text, said = page(
            given.input, episode=given.episode, episodes=given.episodes, frames=given.frames,
            scene=given.scene,
        )  # fmt: skip
        part = out.with_name(f"{out.name}.{os.getpid()}.part")
        part.write_text(text, encoding="utf-8")
        part.replace(out)
    except _core.InputError as error:
        return fail(2, str(error))
    except ModuleNotFoundError as error:
        return fail(3, f"a page of {given.input} needs the package {error.name}")
    except (OSError, _core.IoError) as error:
        return fail(3, str(error))
    if given.json:
        print(json.dumps(said | {"output": str(out)}))
        return 0
    if given.quiet:
        return 0
    size = said["bytes"] / 1e6
    print(f"wrote {out} ({size:.1f} MB): {said['episodes']} episodes, {said['frames']} frames; "
          "open it in a browser")  # fmt: skip
    for note in said["notes"]:
        print(f"note: {note}", file=sys.stderr)
    return 0


if __name__ == "__main__":
    sys.exit(main())
