# SPDX-License-Identifier: Apache-2.0
"""The Python of docs/python.md, docs/learning.md and the examples runs as it stands."""

from __future__ import annotations

import ast
import importlib.util
import json
import re
import runpy
import subprocess
import sys
from pathlib import Path

import h5py
import pytest

import tangere
from tangere import _core

ROOT = Path(__file__).parents[2]


def run_blocks(page: str, names: dict[str, str]) -> int:
    """Runs the blocks of a page in order, because later ones use names of earlier ones."""
    blocks = re.findall(r"```python\n(.*?)```", (ROOT / page).read_text(), re.DOTALL)
    for block in blocks:
        exec(compile(block, page, "exec"), names)
    return len(blocks)


def test_every_block_of_the_page_runs(command, tmp_path, monkeypatch):
    monkeypatch.setenv("SDL_VIDEODRIVER", "dummy")
    pytest.importorskip("torch", reason="PyTorch is not installed")
    pytest.importorskip("jax", reason="JAX is not installed")
    names = {"TANGERE": str(command), "DATA": str(tmp_path / "data")}
    assert run_blocks("docs/python.md", names) >= 5


def test_the_page_of_a_gripper_leads_to_a_training(tmp_path, monkeypatch, capsys):
    pytest.importorskip("torch", reason="PyTorch is not installed")
    monkeypatch.chdir(tmp_path)
    (tmp_path / "out").mkdir()
    monkeypatch.syspath_prepend(tmp_path / "out")
    page = (ROOT / "docs/own_gripper.md").read_text()
    blocks = re.findall(r"```python\n(.*?)```", page, re.DOTALL)
    assert len(blocks) == 4
    assert sum(bool(line.strip()) for line in "".join(blocks[:2]).splitlines()) <= 60
    (tmp_path / "out/lift_egg.py").write_text(blocks[0] + "\n\n" + blocks[1])
    names: dict = {}
    for block in blocks[2:]:
        exec(compile(block, "docs/own_gripper.md", "exec"), names)
    rates = ast.literal_eval(capsys.readouterr().out)
    assert len(rates) == 2 and all(0 < rate < 0.6 for rate in rates.values()), rates
    assert (tmp_path / "out/lift_egg.html").stat().st_size > 1e5
    command = re.search(r"learning/ppo.py (out/lift_egg.py:\S+)", page)
    short = ["--steps", "480", "--envs", "16", "--choices", "1", "--episodes", "20", "--json"]
    done = subprocess.run(
        [sys.executable, str(ROOT / "learning/ppo.py"), command[1], *short, "--length", "30"],
        check=True, capture_output=True, text=True,
    )  # fmt: skip
    assert json.loads(done.stdout)["test"]["episodes"] == 20


def test_every_block_of_the_page_of_learning_runs(generate, capsys):
    data = generate("stable_grasp", "--episodes", "20", "--seed", "1")
    assert run_blocks("docs/learning.md", {"DATA": str(data)}) == 2
    said = capsys.readouterr().out
    assert "20 ['q', 'v', 'flow']" in said and "zeros" in said


def test_every_block_of_the_page_of_formats_runs(generate, capsys):
    pytest.importorskip("zarr", reason="zarr is not installed")
    data = generate("box_pushing", "--episodes", "8", "--seed", "1")
    assert run_blocks("docs/formats.md", {"DATA": str(data)}) == 2
    assert "(100, 13, 10, 3) N" in capsys.readouterr().out


def test_the_reference_is_made_of_the_docstrings():
    path = ROOT / "python/api_reference.py"
    spec = importlib.util.spec_from_file_location("api_reference", path)
    reference = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(reference)
    text, silent = reference.page(Path(tangere.__path__[0]))
    assert silent == []
    assert text == (ROOT / "docs/python_api.md").read_text(encoding="utf-8"), (
        "docs/python_api.md is not current; run python/api_reference.py"
    )
    for name in tangere.__all__:  # nothing of the package is left out
        modules = ("", "gym.", "scene_env.", "scene_builder.", "robots.")
        places = [f"tangere.{module}{name}" for module in modules]
        assert any(p in text for p in places) or name in ("__version__", "instruction_set"), name


def test_the_stub_has_what_the_module_has():
    stub = ast.parse((Path(tangere.__path__[0]) / "_core.pyi").read_text())
    said = {n.name: n for n in stub.body if isinstance(n, (ast.ClassDef, ast.FunctionDef))}
    there = {n for n in vars(_core) if not n.startswith("_") and callable(getattr(_core, n))}
    assert set(said) == there
    for name, node in said.items():
        if isinstance(node, ast.ClassDef) and name not in ("InputError", "IoError"):
            members = {n.name for n in node.body if isinstance(n, ast.FunctionDef)}
            values = [n.targets[0] for n in node.body if isinstance(n, ast.Assign)]
            members |= {n.id for n in values if isinstance(n, ast.Name)}
            own = {n for n in vars(getattr(_core, name)) if not n.startswith("_")}
            assert {n for n in members if not n.startswith("_")} == own, name


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


def test_the_notebook_runs_from_top_to_bottom(tmp_path, monkeypatch, capsys, command):
    monkeypatch.chdir(tmp_path)
    monkeypatch.setenv("TANGERE_PROGRAM", str(command))
    notebook = json.loads((ROOT / "examples/first_touch.ipynb").read_text())
    names: dict = {"__name__": "first_touch"}
    shown = []
    for cell in (c for c in notebook["cells"] if c["cell_type"] == "code"):
        assert cell["outputs"] == [] and cell["execution_count"] is None  # stripped
        body = ast.parse("".join(cell["source"])).body
        last = body.pop() if isinstance(body[-1], ast.Expr) else None
        exec(compile(ast.Module(body, []), "first_touch.ipynb", "exec"), names)
        if last is not None:
            value = ast.Expression(last.value)
            shown.append(eval(compile(value, "first_touch.ipynb", "eval"), names))
    shown = [value for value in shown if value is not None]  # of print
    assert shown[0] == (20, 64, 32, 32, 3) and shown[-1][-3:] == (32, 32, 3)
    assert any("<iframe" in page._repr_html_() for page in shown if hasattr(page, "html"))
    said = capsys.readouterr().out
    assert "@" in said and "32 episodes" in said and ("derivative" in said or "PyTorch" in said)
