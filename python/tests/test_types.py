# SPDX-License-Identifier: Apache-2.0
"""The package and programs that use it pass mypy with the settings of pyproject.toml."""

from __future__ import annotations

import os
import subprocess
import sys
from pathlib import Path

import pytest

import tangere

pytest.importorskip("mypy", reason="mypy is not installed")
ROOT = Path(__file__).parents[2]

RIGHT = """
import numpy as np
import tangere
import tangere.data
batch = tangere.Batch(tangere.Model(tangere.Scene("a.xml")), num_envs=2)
batch.step(np.zeros(3))
force: float = float(batch.tactile("pad")[0, 1, 2, 2])
env = tangere.make_vec("box_pushing", 2)
obs, reward, terminated, truncated, info = env.step(env.scripted_action())
mean: float = float(reward.mean())
names: list[str] = tangere.task_names()
b = tangere.SceneBuilder("a", timestep=np.float32(0.1), gravity=np.zeros(3))
link = b.robot.link("a").link("b")
link.joint("b", "prismatic", axis=(0, 0, 1), lim=[-1, 1])
b.sensor.tactile("b", "rect_array", feels=["a"], feedback=True).imperfections(noise=0.1)
scene: tangere.Scene = b.scene()
class Own(tangere.VectorSceneEnv):
    pass
tangere.data.generate(Own, "d", 3, policy="random")
"""
WRONG = {
    "tangere.Batch('a.xml')": "arg-type",
    "tangere.make_vec('box_pushing', 2).step()": "call-arg",
    "tangere.task_spec('box_pushing').horizont": "attr-defined",
    "tangere.SceneBuilder().robot.link('a').body('spere')": "arg-type",
    "tangere.SceneBuilder().robot.link('a').body('sphere', radus=1)": "arg-type",
    "tangere.SceneBuilder().robot.link('a').boddy('sphere')": "attr-defined",
    "import tangere.data; tangere.data.generate(str, 'd', 3)": "arg-type",
    "x: int = tangere.task_names()": "assignment",
}


def mypy(tmp_path, *words, **options):
    package = Path(tangere.__path__[0]).parent
    return subprocess.run(
        [sys.executable, "-m", "mypy", "--cache-dir", tmp_path / "cache", *words],
        env=os.environ | {"MYPYPATH": str(package)},
        cwd=ROOT, capture_output=True, text=True, **options,
    )  # fmt: skip


def test_the_package_has_types(tmp_path):
    checked = mypy(tmp_path, "-p", "tangere")
    assert checked.returncode == 0, checked.stdout


def test_programs_are_checked_against_them(tmp_path):
    right, wrong = tmp_path / "right.py", tmp_path / "wrong.py"
    right.write_text(RIGHT)
    wrong.write_text("import tangere\n" + "".join(f"{line}\n" for line in WRONG))
    strict = ["--strict", "--follow-imports=silent"]
    examples = [str(path) for path in sorted((ROOT / "examples").glob("*.py"))]
    checked = mypy(tmp_path, *strict, *examples, str(right))
    assert checked.returncode == 0, checked.stdout
    found = mypy(tmp_path, *strict, str(wrong)).stdout.splitlines()
    for number, (line, kind) in enumerate(WRONG.items(), 2):
        assert any(f"wrong.py:{number}:" in f and f"[{kind}]" in f for f in found), (line, found)
