# SPDX-License-Identifier: Apache-2.0
"""UniVTAC's HDF5, a file of each episode, as a format of exports.

    hdf5/0.hdf5, hdf5/1.hdf5 …
        step                             (T)          int64, the number of the frame
        embodiment/joint                 (T, joints)  float32 [rad, m], of joints with a motor
        observation/CAMERA/rgb           (T)          JPEG files, bytes of one length
        tactile/SENSOR/rgb, rgb_marker   (T)          JPEG files
        tactile/SENSOR/press_depth       (T, H, W)    float32 [mm], positive where pressed
        tactile/SENSOR/marker            (T, 2, n, 2) float32 [pixels]: at rest, now; (x, y); of
                                         sensors with a picture
        tactile/SENSOR/force             (T, …)       float32 [N], of Tangere; SENSOR is the
                                         name of an observation where a task observes touch
        action, reward                   (T, na), (T) float32, of Tangere
        q                                (T, nq)      float32 [rad, m], of Tangere, if privileged
    metadata.json                        of the data set

`depth` is the distance from a camera, which is not known here, so it is not written. UniVTAC's
writer hands RGB to an encoder that takes BGR, and its reader decodes to BGR: so the files show
red and blue exchanged, and the arrays that the reader gives are RGB. They are written so here.
"""

from __future__ import annotations

import io
from pathlib import Path
from typing import Any

import h5py
import numpy as np
from PIL import Image

from . import _core
from ._export_frames import (
    Arrays, Frames, action_unit, is_picture, number_units, picture_rows, unit_and_meaning, unit_text
)  # fmt: skip
from ._export_ftp1 import joint_places
from ._export_job import sync, write_json

_EPISODES = 16  # of a part
_PATH = "hdf5/{}.hdf5"
_QUALITY = 95  # of JPEG, what OpenCV takes unless told


class UniVtac:
    """The format.

    joints: coordinates of the robot with commas, of `q_names`. None: those of joints with a motor.
    privileged: all of q comes along, under a name that UniVTAC's reader does not read.
    """

    kind, sign, origin = "UniVTAC data set", "metadata.json", "metadata.json"
    folder_keys, common = False, list[str]()

    def __init__(self, frames: Frames, joints: str | None = None, privileged: bool = False):
        episodes, self.frames = frames.episodes, frames
        if frames.window > 1:
            raise _core.InputError("univtac with a window; expected one row of touch a frame")
        touch = [key for key in episodes.keys if self._is_of_sensor(key)]
        if not touch:
            raise _core.InputError(
                f"{episodes.path}: no reading of a sensor for UniVTAC; its observations are "
                f"{episodes.keys}"
            )
        self.fps = max(1, round(1 / frames.seconds))
        self._pixels = {  # of the pictures of each sensor
            key.split(".")[0]: frames.pads(key)[:2]
            for key in episodes.keys
            if key.split(".")[-1] in ("rgb", "rgb_marker", "height")
        }
        self._joints = joint_places(frames, joints, "joints") if joints else _motors(frames)
        self._all = privileged
        count = len(frames.lengths)
        self._cuts = [*range(0, count, _EPISODES), count]
        self.parts = [
            int(frames.lengths[a:b].sum()) for a, b in zip(self._cuts, self._cuts[1:])
        ]  # fmt: skip
        first = self._arrays(frames.of(0))
        self.names = sorted(first)
        self._windows = sorted(key for key in episodes.windows if self._path(key))
        self.notes = [
            f"UniVTAC has one reading a frame: of the windows of {key} the newest one is written"
            for key in self._windows
        ]
        lost = [key for key in episodes.keys if key != "q" and not self._path(key)]
        if lost:
            self.notes.append(f"left out, because UniVTAC has no place for it: {', '.join(lost)}")

    def job(self) -> dict[str, Any]:
        return {
            "format": "UniVTAC", "joints": self._joints, "names": self.names,
            "h5py": h5py.version.version, "hdf5": h5py.version.hdf5_version,
            "quality": _QUALITY,
        }  # fmt: skip

    def begin(self, folder: Path) -> None:
        (folder / "hdf5").mkdir()

    def write(self, folder: Path, part: int) -> None:
        for place in self._places(part):
            found = self._arrays(self.frames.of(place))
            memory = io.BytesIO()
            with h5py.File(memory, "w", track_order=False) as file:
                for name, rows in found.items():
                    if rows.dtype.kind == "f" and not np.isfinite(rows).all():
                        raise _core.InputError(
                            f"{self.frames.name(place)} has a number in {name!r} that is not "
                            "finite; see `tangere validate`"
                        )
                    file.create_dataset(name, data=rows, track_times=False)
            with open(folder / _PATH.format(place), "wb") as out:
                out.write(memory.getbuffer())
                sync(out)

    def files(self, part: int) -> list[str]:
        return [_PATH.format(place) for place in self._places(part)]

    def _places(self, part: int) -> range:
        return range(self._cuts[part], self._cuts[part + 1])

    def finish(self, folder: Path) -> None:
        """What the data set is."""
        frames, episodes = self.frames, self.frames.episodes
        (folder / "metadata.json").unlink(missing_ok=True)
        said = {
            "command": episodes.command,
            "tangere_version": str(episodes.attributes["tangere_version"]),
            "task": episodes.task,
            "seconds_per_frame": frames.seconds,
            "frames": len(frames),
            "joints": [str(episodes.attributes["q_names"][i]) for i in self._joints],
            "joint_units": [str(episodes.attributes["q_units"][i]) for i in self._joints],
            **frames.scene_note(),
            "datasets": self.names,
            "units": {name: unit for name in self.names if (unit := self._unit(name))},
            **({"newest_of_window": self._windows} if self._windows else {}),
            "episodes": [
                {
                    "demo": episodes.names[i], "steps": int(length),
                    "success": bool(i in frames.solved),
                }
                for i, length in zip(frames.chosen, frames.lengths, strict=True)
            ],
        }  # fmt: skip
        write_json(folder / "metadata.json", said)

    def _unit(self, name: str) -> str:
        units = {"press_depth": "mm", "marker": "pixels"}
        if name == "action":
            return action_unit(self.frames.episodes)
        if name in ("q", "embodiment/joint"):
            places = [] if name == "q" else self._joints
            return unit_text(number_units(self.frames.episodes, "q", 1, places))
        owner, _, reading = name.removeprefix("tactile/").partition("/")
        if reading == "force":
            return unit_and_meaning(self.frames.episodes, owner)[0]
        return units.get(reading, "")

    def _is_of_sensor(self, key: str) -> bool:
        """Whether it is a reading of a sensor, or touch that a task observes."""
        episodes = self.frames.episodes
        return key.split(".")[0] in episodes.sensors or key in episodes.touch

    def _arrays(self, arrays: Arrays) -> Arrays:
        """PATH → rows of an episode."""
        frames, episodes = self.frames, self.frames.episodes
        found: Arrays = {
            "step": np.arange(len(arrays["actions"])),
            "embodiment/joint": arrays["q"][:, self._joints].astype(np.float32),
            "action": arrays["actions"],
            "reward": arrays["rewards"],
        }
        if self._all:
            found["q"] = arrays["q"].astype(np.float32)
        for key in episodes.keys:
            path = self._path(key)
            owner, _, reading = key.partition(".")
            if not path:
                continue
            if is_picture(frames.shapes[key], frames.types[key]):
                found[path] = _jpeg_rows(picture_rows(arrays, key))
            elif not reading:
                found[path] = self._newest(arrays, key).astype(np.float32)
            elif reading == "height":
                found[path] = (1000 * self._newest(arrays, key)[..., 0]).astype(np.float32)
            else:
                found[path] = marker_pixels(
                    self._newest(arrays, key), episodes.sensors[owner], self._pixels[owner]
                )
        return found

    def _path(self, key: str) -> str:
        """Where an observation is written; empty if it is left out."""
        frames, episodes = self.frames, self.frames.episodes
        owner, _, reading = key.partition(".")
        if is_picture(frames.shapes[key], frames.types[key]):
            return f"{'tactile' if owner in episodes.sensors else 'observation'}/{owner}/{reading}"
        if not self._is_of_sensor(key):
            return ""
        if not reading:
            return f"tactile/{owner}/force" if unit_and_meaning(episodes, key)[0] == "N" else ""
        if reading == "height":
            return f"tactile/{owner}/press_depth"
        return f"tactile/{owner}/marker" if reading == "markers" and owner in self._pixels else ""

    def _newest(self, arrays: Arrays, key: str) -> np.ndarray:
        """The reading at each row."""
        return arrays[key][:, -1] if self.frames.has_window(key) else arrays[key]


def _motors(frames: Frames) -> list[int]:
    """Places in q of joints with a motor."""
    episodes = frames.episodes
    places = episodes.driven("q")
    if not places or "q" not in frames.shapes:
        names = ", ".join(str(name) for name in episodes.attributes["q_names"])
        why = "no joint has a motor" if "q" in frames.shapes else "it has no q (--record q)"
        raise _core.InputError(
            f"{episodes.path}: UniVTAC needs joints of a robot, and {why}; expected joints "
            f"(--joints) of {names}"
        )
    return places


def marker_pixels(moved: np.ndarray, sensor: dict[str, Any], pixels: tuple[int, ...]) -> np.ndarray:
    """(T, 2, n, 2) places of markers in a picture, at rest and now, (x, y) [pixels].

    moved: (T, rows, cols, 2) displacements along axis0 and axis1 [m]. pixels: rows and columns of
    the picture. The middle of the points is the middle of the picture; rows follow axis0.
    """
    rows, cols = moved.shape[1:3]
    away = np.asarray(sensor["corner1"]) - np.asarray(sensor["corner0"])
    size = np.asarray(sensor["picture_pixel_size"])  # down, across
    pitch = [
        float(np.dot(away, sensor[axis])) / (count - 1)
        for axis, count in (("axis0", rows), ("axis1", cols))
    ]
    place = np.stack(np.meshgrid(
        *(pitch[a] * (np.arange(count) - (count - 1) / 2) for a, count in enumerate((rows, cols))),
        indexing="ij",
    ), axis=-1)  # fmt: skip
    both = np.stack([np.broadcast_to(place, moved.shape), place + moved], axis=1)
    both = both / size + np.asarray(pixels) / 2
    x, y = both[..., 1], both[..., 0]
    if sensor.get("picture_mirror"):
        x = pixels[1] - x
    return np.stack([x, y], axis=-1).reshape(len(moved), 2, -1, 2).astype(np.float32)


def _jpeg_rows(pictures: np.ndarray) -> np.ndarray:
    """(T) bytes of one length, JPEG files of pictures (T, height, width, 3)."""
    files = []
    for picture in pictures:
        memory = io.BytesIO()
        Image.fromarray(np.ascontiguousarray(picture[..., ::-1])).save(
            memory, "JPEG", quality=_QUALITY
        )
        files.append(memory.getvalue())
    return np.asarray(files, f"S{max(map(len, files))}")
