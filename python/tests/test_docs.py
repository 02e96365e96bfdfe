# SPDX-License-Identifier: Apache-2.0
"""The Python of docs/python.md and the examples run as they stand."""

from __future__ import annotations

import re
import runpy
from pathlib import Path

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


def test_the_example_draws_a_round_touch(capsys):
    runpy.run_path(str(ROOT / "examples/press.py"))
    lines = capsys.readouterr().out.splitlines()
    assert lines[0].startswith("push down") and "@" in "".join(lines[2:])
