# SPDX-License-Identifier: Apache-2.0
"""The collection of examples/collection.py, with one episode of each part."""

from __future__ import annotations

import importlib.util
import os
import re
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

import tangere
from tangere.data import Episodes
from tangere.export import export

PATH = Path(__file__).parents[2] / "examples/collection.py"


@pytest.fixture(scope="module")
def collection():
    spec = importlib.util.spec_from_file_location("collection", PATH)
    module = importlib.util.module_from_spec(spec)
    sys.modules["collection"] = module  # which its dataclass needs
    spec.loader.exec_module(module)
    fewer = {"200": "80", "300": "100"}  # steps
    for part in module.PARTS:
        part.options = tuple(fewer.get(word, word) for word in part.options)
    return module


def test_all_parts_are_made_and_named_by_the_card(collection, command, tmp_path, monkeypatch):
    monkeypatch.setenv("TANGERE_PROGRAM", str(command))
    monkeypatch.setattr(sys, "argv", ["collection.py", str(tmp_path), "--episodes", "11"])
    assert collection.main() == 0
    card = (tmp_path / "README.md").read_text()
    for part in collection.PARTS:
        data = Episodes(tmp_path / part.name)
        assert len(data) == 1 and f"| {part.name} | 1 | {data.lengths[0]} |" in card
        assert f"{data.content:016x}" in card and data.command in card
    assert sum(part.share for part in collection.PARTS) == 100
    fields = []
    for mesh in collection.MESHES:
        touched = Episodes(tmp_path / f"touch_{mesh}")
        fields.append(touched[0]["left_finger"])
        assert np.abs(fields[-1]).max() > 0.02 and np.ptp(touched[0]["eye.rgb"]) > 50
        varied = set(touched.attributes["randomized_names"])
        assert {f"body {mesh} density", "tactile left_finger kn"} <= varied
    assert np.abs(fields[0] - fields[1]).max() > 0.02  # other surfaces
    forces = [
        np.abs(Episodes(tmp_path / f"touch_gel_{kind}")[0]["gel"]).max()
        for kind in collection.GELS
    ]
    assert 0 < forces[0] < forces[1] < forces[2]  # a softer gel gives way
    export(tmp_path / "touch_pebble", tmp_path / "pebble_lerobot", "lerobot", workers=1)
    before = (tmp_path / "box_pushing/shard-00000.h5").stat().st_mtime_ns
    assert collection.main() == 0  # nothing is left to do
    assert (tmp_path / "box_pushing/shard-00000.h5").stat().st_mtime_ns == before
    assert re.findall("Licence: (.*?)[.] ", (tmp_path / "README.md").read_text()) == ["CC0-1.0"]
    text = (tmp_path / "touch_pebble.xml").read_text()
    assert "mug" not in text.replace("mug.xml of Tangere", "") and str(tmp_path) not in card + text
    moved = tmp_path.rename(tmp_path.with_name("moved"))  # as to another machine
    environment = os.environ | {"TANGERE_PYTHON": sys.executable}
    for name in ("touch_mug", "touch_pebble", "touch_gel_soft", "pebble_lerobot"):
        words = [command, "view", moved / name, "-o", moved / f"{name}.html"]
        run = subprocess.run(words, capture_output=True, text=True, env=environment)
        assert run.returncode == 0, run.stderr
    export(moved / "touch_mug", moved / "mug.csv", "csv")


def test_the_episodes_are_those_asked_for(collection, monkeypatch, capsys):
    shares = [part.share for part in collection.PARTS]
    assert collection.shared(10000) == [100 * share for share in shares]
    assert collection.shared(11) == [1] * 11
    for episodes in (12, 60, 99, 176, 1234):
        counts = collection.shared(episodes)
        assert sum(counts) == episodes and min(counts) >= 1
        assert all(abs(n - episodes * s / 100) <= 1 or n == 1 for n, s in zip(counts, shares)) or (
            episodes < 100
        )
    monkeypatch.setattr(sys, "argv", ["collection.py", "out", "--episodes", "10"])
    with pytest.raises(SystemExit):
        collection.main()
    assert "--episodes 10; expected 11 or more" in capsys.readouterr().err


def test_a_scene_that_has_changed_is_told(collection):
    with pytest.raises(tangere.InputError, match="mug: no 'nothing like it'; expected the scene"):
        collection.changed("mug", (("nothing like it", "x"),))


def test_other_settings_are_refused_in_a_sentence(collection, tmp_path, monkeypatch, capsys):
    def refuse(*arguments):
        raise tangere.InputError("'box_pushing' was made with other settings")

    monkeypatch.setattr(collection, "make", refuse)
    monkeypatch.setattr(sys, "argv", ["collection.py", str(tmp_path), "--seed", "2"])
    assert collection.main() == 2
    assert capsys.readouterr().err == "collection.py: 'box_pushing' was made with other settings\n"
