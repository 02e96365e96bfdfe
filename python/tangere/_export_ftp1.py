# SPDX-License-Identifier: Apache-2.0
"""FTP-1's Zarr, as its loader and its converters have it, as a format of exports.

    data/timestamps                     (T)               int64, the frame in its episode
    data/sub_task_instruction           (T)               the text of the task
    data/SIDE_tactile_data_GROUP        (T, N, *shape)    float32 [N] of a field, uint8 of a picture
    data/SIDE_tactile_area_GROUP        (T, N)            int64: 0, 1 … of the pads
    data/SIDE_tactile_sensor_GROUP      (T)               the sensor's name
    data/SIDE_tactile_type_GROUP        (T)               "image" of a picture, "matrix" of a field,
                                                          "state" of a vector
    data/camera_main_rgb                (T, H, W, 3)      uint8, of the first camera
    data/SIDE_arm_joints                (T, joints)       float32 [rad, m], of the joints named
    data/SIDE_hand_joints               (T, joints)       float32 [rad, m], of the hand
    data/SIDE_hand_joints_idx           (T, joints)       int32, which joint of FTP-1's hand each is
    data/action, data/reward            (T, na), (T)      of Tangere; the loader makes its own
    meta/episode_ends                   (episodes)        int64

A group is a reading of sensors, with dots as underlines. The type chooses the encoder of FTP-1: a
matrix has two or three axes behind N, a state one. So a window of n readings has no axis: its n
readings are one after the other on the last axis, (…, n c), the newest last.
"""

from __future__ import annotations

import re
from typing import Any

import numpy as np

from . import _core
from ._export_frames import Arrays, Frames, is_picture, number_units, picture_rows, unit_text
from ._export_zarr import Column, ZarrStore, attributes_of
from ._lerobot_format import task_text

_AREA = np.dtype(np.int64)
_ARM_JOINTS = 7  # at most
_HAND_JOINTS = 32  # numbers of joints
_GRIPPER = 28  # that of the opening of a gripper


class Ftp1(ZarrStore):
    """The format.

    side: of the hand that carries the sensors. sensor: their name in the data. joints: coordinates
    of the arm with commas, of `q_names`. hand: those of the hand with numbers of FTP-1's joints,
    "thumb=1,index=6"; one alone is a gripper, 28. task: the text; None: the task's name
    and its success.
    """

    def __init__(
        self, frames: Frames, side: str = "right", sensor: str = "tangere",
        joints: str | None = None, hand: str | None = None, task: str | None = None,
    ):  # fmt: skip
        episodes = frames.episodes
        if side not in ("left", "right"):
            raise _core.InputError(f"side {side!r}; expected left or right")
        self._text, self._sensor = task_text(frames, task), sensor
        about = attributes_of(frames)
        self._groups: dict[str, str] = {}  # group → key
        columns = {
            "timestamps": Column((), np.dtype(np.int64), {"unit": f"{frames.seconds:g} s"}),
            "sub_task_instruction": Column((), np.dtype(f"<U{len(self._text)}"), {}),
        }
        for key in episodes.keys:
            picture = is_picture(frames.shapes[key], frames.types[key])
            if not frames.is_touch(key) and key.split(".")[0] not in episodes.sensors:
                continue
            group = re.sub(r"\W", "_", key)
            start = f"{side}_tactile"
            first = frames.of(0)[key]
            shape = (1, *first.shape[1:]) if picture else _samples(frames, key, first).shape[1:]
            kind = _kind(picture, shape)
            self._groups[group] = key
            dtype = np.dtype(np.uint8 if picture else np.float32)
            columns |= {
                f"{start}_data_{group}": Column(shape, dtype, about[key]),
                f"{start}_area_{group}": Column(shape[:1], _AREA, {}),
                f"{start}_sensor_{group}": Column((), np.dtype(f"<U{len(sensor)}"), {}),
                f"{start}_type_{group}": Column((), np.dtype(f"<U{len(kind)}"), {}),
            }
        if not self._groups:
            raise _core.InputError(
                f"{episodes.path}: no reading of a sensor for FTP-1; its observations are "
                f"{episodes.keys}"
            )
        self._start, self._joints = f"{side}_tactile", joint_places(frames, joints, "joints")
        if len(self._joints) > _ARM_JOINTS:
            raise _core.InputError(f"{len(self._joints)} joints; expected {_ARM_JOINTS} at most")
        self._hand_key, self._slots = f"{side}_hand_joints", hand_slots(hand)
        self._hand = joint_places(frames, ",".join(self._slots), "hand")
        shape = (len(self._hand),)
        if self._hand:
            columns[self._hand_key] = Column(
                shape, np.dtype(np.float32),
                {"names": [*self._slots]} | _unit(frames, self._hand),
            )  # fmt: skip
            columns[f"{self._hand_key}_idx"] = Column(shape, np.dtype(np.int32), {})
        self.notes = [] if self._hand else [
            "FTP-1's loader reads the touch of a hand with joints alone; see --hand"
        ]  # fmt: skip
        camera = self._camera_of(frames)
        written = {camera, *self._groups.values(), *(["q"] if self._joints or self._hand else [])}
        lost = [key for key in episodes.keys if key not in written]
        if lost:
            self.notes.append(f"left out, because FTP-1 has no place for it: {', '.join(lost)}")
        if self._joints:
            names = {"names": joints.split(",") if joints else []}
            columns[f"{side}_arm_joints"] = Column(
                (len(self._joints),), np.dtype(np.float32), names | _unit(frames, self._joints)
            )
        self._arm = f"{side}_arm_joints"
        self._camera = camera
        if self._camera:
            shape = frames.shapes[self._camera]
            columns["camera_main_rgb"] = Column(shape, np.dtype(np.uint8), {"key": self._camera})
        columns["action"] = Column(frames.shapes["actions"], np.dtype(np.float32), about["action"])
        columns["reward"] = Column((), np.dtype(np.float32), {})
        super().__init__(frames, columns)

    @staticmethod
    def _camera_of(frames: Frames) -> str | None:
        """The first picture in colours of a camera."""
        return next((
            key for key in frames.episodes.keys
            if key.rpartition(".")[0] in frames.episodes.cameras
            and is_picture(frames.shapes[key], frames.types[key])
        ), None)  # fmt: skip

    def job(self) -> dict[str, Any]:
        said = {"text": self._text, "sensor": self._sensor, "joints": self._joints,
                "hand": self._slots}  # fmt: skip
        return super().job() | said

    def arrays(self, frames: Arrays, start: int) -> Arrays:
        count = len(frames["actions"])
        ends, lengths = self.frames.ends, self.frames.lengths
        at = np.arange(start, start + count)
        place = np.searchsorted(ends, at, "right")
        found: Arrays = {
            "timestamps": at - (ends - lengths)[place],
            "sub_task_instruction": np.full(count, self._text),
            "action": frames["actions"],
            "reward": frames["rewards"],
        }
        for group, key in self._groups.items():
            column = self.columns[f"{self._start}_data_{group}"]
            pads = column.shape[0]
            picture = column.dtype == np.uint8
            rows = (
                picture_rows(frames, key)[:, None]
                if picture
                else _samples(self.frames, key, frames[key])
            )
            found |= {
                f"{self._start}_data_{group}": rows.astype(column.dtype, copy=False),
                f"{self._start}_area_{group}": np.tile(np.arange(pads), (count, 1)),
                f"{self._start}_sensor_{group}": np.full(count, self._sensor),
                f"{self._start}_type_{group}": np.full(count, _kind(picture, column.shape)),
            }
        if self._joints:
            found[self._arm] = frames["q"][:, self._joints].astype(np.float32)
        if self._hand:
            found[self._hand_key] = frames["q"][:, self._hand].astype(np.float32)
            found[f"{self._hand_key}_idx"] = np.tile([*self._slots.values()], (count, 1))
        if self._camera:
            found["camera_main_rgb"] = picture_rows(frames, self._camera)
        return found


def _unit(frames: Frames, places: list[int]) -> dict[str, str]:
    """Of coordinates, as an array says it."""
    return {"unit": unit_text(number_units(frames.episodes, "q", 1, places))}


def _kind(picture: bool, shape: tuple[int, ...]) -> str:
    """The type of a reading (N, …)."""
    return "image" if picture else "matrix" if len(shape) > 2 else "state"


def _samples(frames: Frames, key: str, rows: np.ndarray) -> np.ndarray:
    """A reading of frames as (t, N, *shape), a window on the last axis of the shape."""
    apart = frames.pads_apart(key, rows)
    if key not in frames.windows:
        return apart
    apart = np.moveaxis(apart, 2, -2)
    return apart.reshape(*apart.shape[:-2], -1)


def hand_slots(hand: str | None) -> dict[str, int]:
    """Coordinate → number of FTP-1's joint, of "thumb=1,index=6"."""
    slots: dict[str, int] = {}
    words = hand.split(",") if hand else []
    for word in words:
        name, equals, number = word.rpartition("=")
        if not equals and len(words) == 1:
            name, number = word, str(_GRIPPER)
        fits = number.isdecimal() and int(number) < _HAND_JOINTS
        if not name or not fits or name in slots or int(number) in slots.values():
            raise _core.InputError(
                f"hand {word!r}; expected NAME=NUMBER, each once, the number of a joint from 0 to "
                f"{_HAND_JOINTS - 1}"
            )
        slots[name] = int(number)
    return slots


def joint_places(frames: Frames, joints: str | None, option: str) -> list[int]:
    """The places of coordinates in q, by their names with commas between them."""
    if not joints:
        return []
    known = [str(name) for name in frames.episodes.attributes["q_names"]]
    names = joints.split(",")
    unknown = [name for name in names if name not in known]
    if unknown:
        why = ", an observation" if unknown[0] in frames.shapes else ""
        raise _core.InputError(
            f"{option} {unknown[0]!r}{why}; expected names of q: {', '.join(known)}"
        )
    if "q" not in frames.shapes:
        raise _core.InputError(
            f"{frames.episodes.path}: {option} of a data set without q; expected one made with "
            "--record q"
        )
    return [known.index(name) for name in names]
