# SPDX-License-Identifier: Apache-2.0
"""The Python of docs/python.md and the examples run as they stand."""

from __future__ import annotations

import re
import runpy
import subprocess
import sys
from pathlib import Path

import h5py
import pytest

ROOT = Path(__file__).parents[2]


def test_every_block_of_the_page_runs(command, tmp_path):
    pytest.importorskip("torch", reason="PyTorch is not installed")
    page = (ROOT / "docs/python.md").read_text()
    blocks = re.findall(r"```python\n(.*?)```", page, re.DOTALL)
    assert len(blocks) >= 5
    names = {"TANGERE": str(command), "DATA": str(tmp_path / "data")}
    for block in blocks:  # in order: later ones use names of earlier ones
        exec(compile(block, "docs/python.md", "exec"), names)


def test_every_block_of_the_page_of_policies_runs(command, tmp_path, monkeypatch):
    page = (ROOT / "docs/policies.md").read_text()
    blocks = re.findall(r"```python\n(.*?)```", page, re.DOTALL)
    assert len(blocks) == 2
    monkeypatch.chdir(tmp_path)
    (tmp_path / "out").mkdir()
    names = {"__name__": "my_policy"}
    for block in blocks:
        exec(compile(block, "docs/policies.md", "exec"), names)
    assert names["said"]["policy"] == "program"
    (tmp_path / "my_policy.py").write_text(blocks[0])
    program = f"{sys.executable} my_policy.py"
    words = ["box_pushing", "--episodes", "32", "--output", "out/own", "--program", program]
    subprocess.run([command, "generate", *words], check=True, capture_output=True, cwd=tmp_path)
    with h5py.File("out/own/shard-00000.h5") as own, h5py.File("out/mine/shard-00000.h5") as mine:
        assert own.attrs["content_sum"] == mine.attrs["content_sum"]


def test_the_example_draws_a_round_touch(capsys):
    runpy.run_path(str(ROOT / "examples/press.py"))
    lines = capsys.readouterr().out.splitlines()
    assert lines[0].startswith("push down") and "@" in "".join(lines[2:])
