# SPDX-License-Identifier: Apache-2.0
"""Robots from URDF and MJCF files as scenes, to which Python adds."""

from __future__ import annotations

import warnings
from pathlib import Path
from typing import Mapping, Sequence, TypeAlias, Union

from . import _core
from .scene_builder import SceneBuilder

Place: TypeAlias = Union[str, Sequence[float]]


def import_robot(
    path: str | Path,
    *,
    pads: Mapping[str, str | Path | tuple[str | Path, Place]] | None = None,
    motors: Mapping[str, str | float | Sequence[float]] | None = None,
    contacts: Sequence[tuple[str, str]] = (),
    end_effectors: Sequence[str] = (),
    keyframe: str = "",
    base: str = "fixed",
    drop: bool = False,
    allow_unknown: bool = False,
    folder: str | Path | None = None,
) -> SceneBuilder:
    """A robot's URDF or MJCF file as a scene, as the command `tangere import` makes it
    ([robots](robots.md)), to which further elements may be added.

    Parameters
    ----------
    path: of the file.
    pads: skins by link, or by site of MJCF: a layout of the program such as "digit_guess", or
        a file; as (layout, place) on a face of the link's box, "+x" to "-z", or at x y z [m] or
        x y z roll pitch yaw [m, rad] in the link's frame.
    motors: by joint: "force", within the file's effort, or gains P or (P, D) [N/m or N m/rad,
        N s/m or N m s/rad].
    contacts: pairs of links that touch; "ground" as the second is the ground.
    end_effectors: links, or sites of MJCF, whose places a run stores.
    keyframe: of MJCF, in which the scene starts.
    base: "fixed" or "free": whether the root link moves freely.
    drop: leave out what scenes do not have although the motion differs by it.
    allow_unknown: unknown elements and attributes are warnings.
    folder: where the scene will lie, which names meshes relative to it; that of `path` if None.

    What the file has and the scene has not, or has in another way, is a UserWarning. Raises
    InputError and OSError as the command does.
    """
    if base not in ("fixed", "free"):
        raise _core.InputError(f"base {base!r}; expected 'fixed' or 'free'")
    output = Path(path).parent if folder is None else Path(folder)
    output /= Path(path).stem + ".xml"
    gains = {
        joint: [] if law == "force" else _numbers(law, f"motor of '{joint}'", "'force', P or P, D")
        for joint, law in (motors or {}).items()
    }
    text, lost, changed, warned = _core.robot_scene(
        path, output, [_pad(link, pad) for link, pad in (pads or {}).items()], list(gains.items()),
        list(contacts), list(end_effectors), keyframe, base == "free", allow_unknown,
    )  # fmt: skip
    if lost and not drop:
        what = f"{path}: scenes cannot say this, and the motion differs without it:"
        raise _core.InputError("\n  ".join([what, *lost]) + "\ndrop=True leaves it out")
    told = [f"left out, and the motion differs by it: {line}" for line in lost]
    told += [f"said in another way: {line}" for line in changed]
    own = [line for line in warned if not line.startswith(f"{output}:")]  # those scene() gives
    for line in [*own, *told]:
        warnings.warn(line, UserWarning, stacklevel=2)
    return SceneBuilder.from_string(text, output)


def _pad(link: str, pad: object) -> tuple[str, str, str, str, list[float]]:
    """Link, name and text of the layout, face, place."""
    layout, place = pad if isinstance(pad, tuple) else (pad, [0.0] * 6)
    own = Path(__file__).parent / "scenes" / "sensors"
    file = own / f"{layout}.xml"
    if not file.is_file():
        file = Path(layout)
    if not file.is_file():
        near = _core.suggestion(str(layout), sorted(p.stem for p in own.glob("*.xml")))
        raise _core.InputError(
            f"pad of '{link}': '{layout}' is neither a file nor a layout of the program{near}"
        )
    text = file.read_text(encoding="utf-8")
    if isinstance(place, str):
        return link, str(layout), text, place, [0.0] * 6
    x = _numbers(place, f"pad of '{link}'", "x y z or x y z roll pitch yaw", (3, 6))
    return link, str(layout), text, "", x + [0.0] * (6 - len(x))


def _numbers(
    given: object, what: str, expected: str, counts: tuple[int, int] = (1, 2)
) -> list[float]:
    values = [given] if isinstance(given, (int, float)) else given
    try:
        numbers = [float(x) for x in values]  # type: ignore[attr-defined]
    except (TypeError, ValueError):
        numbers = []
    if isinstance(given, str) or len(numbers) not in counts:
        raise _core.InputError(f"{what}: {given!r}; expected {expected}")
    return numbers
