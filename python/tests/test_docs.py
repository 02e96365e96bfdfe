# SPDX-License-Identifier: Apache-2.0
"""The Python of docs/python.md, docs/learning.md and the examples runs as it stands."""

from __future__ import annotations

import re
import runpy
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[2]


def run_blocks(page: str, names: dict[str, str]) -> int:
    """Runs the blocks of a page in order, because later ones use names of earlier ones."""
    blocks = re.findall(r"```python\n(.*?)```", (ROOT / page).read_text(), re.DOTALL)
    for block in blocks:
        exec(compile(block, page, "exec"), names)
    return len(blocks)


def test_every_block_of_the_page_runs(command, tmp_path):
    pytest.importorskip("torch", reason="PyTorch is not installed")
    names = {"TANGERE": str(command), "DATA": str(tmp_path / "data")}
    assert run_blocks("docs/python.md", names) >= 5


def test_every_block_of_the_page_of_learning_runs(generate, capsys):
    data = generate("stable_grasp", "--episodes", "20", "--seed", "1")
    assert run_blocks("docs/learning.md", {"DATA": str(data)}) == 2
    said = capsys.readouterr().out
    assert "20 ['q', 'v', 'flow']" in said and "zeros" in said


def test_the_example_draws_a_round_touch(capsys):
    runpy.run_path(str(ROOT / "examples/press.py"))
    lines = capsys.readouterr().out.splitlines()
    assert lines[0].startswith("push down") and "@" in "".join(lines[2:])
