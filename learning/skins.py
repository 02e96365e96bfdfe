# SPDX-License-Identifier: Apache-2.0
"""Other skins on the pads of a task, to see which policies still work with them.

    skin_scene("stable_grasp", "layer")       # for scene= of the task's environments

Springs are those of the task's scene. A layer has the mean stiffness of the springs beneath each
point, but its points share the load, as those of a gel do (docs/layer.md). The others are springs
with flaws (docs/sensors.md).
"""

from __future__ import annotations

import re

import tangere

KN, AREA = 250.0, 2.25e-6  # of a point of the pads: the scenes' stiffness [N/m], and its area [m²]
THICKNESS = 5e-3  # [m]; a layer resolves points that are at most a third of it apart
MODULUS = KN / AREA * THICKNESS / 2.3  # [Pa] of a gel with that stiffness (docs/skin.md)

#: Attributes and children of the tactile sensors, by the name of the skin.
SKINS = {
    "springs": ("", ""),
    "layer": (f'modulus="{MODULUS:.6g}" thickness="{THICKNESS}"', "<layer/>"),
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
    return tangere.Scene.from_string(changed)
