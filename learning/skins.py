# SPDX-License-Identifier: Apache-2.0
"""Other skins on the pads of a task, to see which policies still work with them.

    skin_scene("stable_grasp", "layer")       # for scene= of the task's environments

Springs are those of the task's scene. A layer has their mean stiffness and their friction, but its
points share the load, as those of a gel do (docs/layer.md). What the scene draws for the springs is
drawn for it. The others are springs with flaws (docs/sensors.md).
"""

from __future__ import annotations

import re

import tangere

KN, KT = 250.0, 1.25  # of a point of the scenes' pads [N/m], [N s/m]
AREA = 2.25e-6  # of a point [m²]
THICKNESS = 5e-3  # [m]; a layer resolves points that are at most a third of it apart
MODULUS = KN / AREA * THICKNESS / 2.3  # [Pa] of a gel with that stiffness (docs/skin.md)

#: Attributes and children of the tactile sensors, by the name of the skin.
SKINS = {
    "springs": ("", ""),
    "layer": (
        f'modulus="{MODULUS:.6g}" thickness="{THICKNESS}" kn="{KN / AREA:.6g}" '
        f'kt="{KT / AREA:.6g}" ks="0" mu="1.5"',
        "<layer/>",
    ),
    "scaled": ("", '<imperfections sensor_gain="0.3" gain="0.1"/>'),
    "shifted": ("", '<imperfections bias="0.01"/>'),
    "late": ("", '<imperfections delay="0.025"/>'),
}


def skin_scene(task: str, skin: str) -> tangere.Scene:
    """The scene of a task with another skin on all of its pads."""
    text = tangere.scenes()[tangere.task_spec(task).scene.removesuffix(".xml")].read_text()
    attributes, child = SKINS[skin]
    changed, count = re.subn(
        r'<tactile (name="\w+" body=[^>]*?)/>', rf"<tactile \1 {attributes}>{child}</tactile>", text
    )
    if count == 0:
        raise SystemExit(f"the scene of {task!r} has no tactile sensor of one line")
    if "modulus" in attributes:  # numbers of a material count by area, and so do their draws
        changed = re.sub(
            r'(<tactile name="\w+" field="k[nt]" uniform=")(\S+) (\S+)"',
            lambda m: f'{m[1]}{float(m[2]) / AREA:.6g} {float(m[3]) / AREA:.6g}"',
            changed,
        )
    return tangere.Scene.from_string(changed)
