# SPDX-License-Identifier: Apache-2.0
"""Videos of a LeRobot data set, by PyAV: one file of each part and picture, episode after episode.

    videos/observation.images.KEY/chunk-000/file-000.mp4

A frame of the video is a picture, so time stamps are multiples of 1/fps. The colours lose what the
codec takes away; `image` keeps them.
"""

from __future__ import annotations

import os
from pathlib import Path
from typing import Any

import numpy as np

from . import _core
from ._lerobot_features import Feature

PATH = "videos/{video_key}/chunk-{chunk_index:03d}/file-{file_index:03d}.mp4"
_CODEC, _LAYOUT = "libsvtav1", "yuv420p"
_OPTIONS = {"g": "2", "crf": "30", "preset": "10"}  # every second frame stands alone, as lerobot's


def _av() -> Any:
    os.environ.setdefault("SVT_LOG", "1")  # the encoder prints errors alone
    try:
        import av
    except ImportError:
        raise _core.IoError(
            "pictures 'video' without the package av; expected it from `pip install av`, or "
            "pictures 'image'"
        ) from None
    return av


def check_video(feature: Feature) -> None:
    """Raises IoError without PyAV, InputError for a size that the codec does not take."""
    _av()
    height, width = feature.shape[:2]
    if height % 2 or width % 2 or min(height, width) < 64:
        raise _core.InputError(
            f"{feature.name}: pictures of {height} × {width} as video; expected even sizes of 64 "
            "or more, or pictures 'image'"
        )


def described(feature: Feature, fps: int) -> dict[str, Any]:
    """What info.json says of a video besides."""
    height, width, channels = feature.shape
    return {
        "video.height": height,
        "video.width": width,
        "video.codec": "av1",
        "video.pix_fmt": _LAYOUT,
        "video.is_depth_map": False,
        "video.fps": fps,
        "video.channels": channels,
        "has_audio": False,
    }


class Video:
    """A video file on its way; replaces one that a killed run has left."""

    def __init__(self, path: Path, feature: Feature, fps: int):
        self._av = _av()
        path.parent.mkdir(parents=True, exist_ok=True)
        self._file = self._av.open(str(path), "w")
        self._stream = self._file.add_stream(_CODEC, fps, options=_OPTIONS)
        self._stream.height, self._stream.width = feature.shape[:2]
        self._stream.pix_fmt = _LAYOUT
        self._stream.codec_context.thread_count = 1  # the same bytes on every machine

    def add(self, pictures: np.ndarray) -> None:
        """Pictures (n, height, width, 3) uint8."""
        for picture in pictures:
            frame = self._av.VideoFrame.from_ndarray(np.ascontiguousarray(picture), "rgb24")
            self._file.mux(self._stream.encode(frame))

    def close(self) -> None:
        """Ends the file."""
        self._file.mux(self._stream.encode())
        self._file.close()
