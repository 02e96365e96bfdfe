# SPDX-License-Identifier: Apache-2.0
"""Pages of exports: the numbers are those of the page of the data set."""

from __future__ import annotations

import base64
import json
import os
import re
import subprocess
import sys

import h5py
import numpy as np
import pytest

import tangere
from tangere import export as exports

pytest.importorskip("pyarrow", reason="pyarrow is not installed")
pytest.importorskip("zarr", reason="zarr is not installed")
pytest.importorskip("PIL.Image", reason="pillow is not installed")


@pytest.fixture(scope="module")
def touched(generate, tmp_path_factory):
    """Two episodes of a ball of many sizes that is rolled, with a window of touch and a camera."""
    text = tangere.scenes()["rolling_ball_small"].read_text()
    eye = '<camera name="eye" pos="0 -0.2 0.1" look="0 0 0" rows="24" cols="32"/></sensor>'
    scene = tmp_path_factory.mktemp("scene") / "seen.xml"
    scene.write_text(text.replace("</sensor>", eye))
    return generate(str(scene), "--episodes", "2", "--steps", "120", "--every", "20", "--seed",
                    "4", "--record", "q,pad/10,eye.rgb")  # fmt: skip


OCTAHEDRON = """v 0.02 0 0
v -0.02 0 0
v 0 0.02 0
v 0 -0.02 0
v 0 0 0.02
v 0 0 -0.02
""" + "".join(f"f {a} {b} {c}\n" for a, b, c in (
    (1, 3, 5), (3, 2, 5), (2, 4, 5), (4, 1, 5), (3, 1, 6), (2, 3, 6), (4, 2, 6), (1, 4, 6)))


def block(text):
    found = re.search(r'<script type="application/json"[^>]*>(.*?)</script>', text, re.DOTALL)
    assert found, text[:300]
    return json.loads(found.group(1))


def numbers(array, kind=np.float32):
    return np.frombuffer(base64.b64decode(array["base64"]), kind)


def rows_of(array, count):
    return numbers(array).reshape(count, -1)


@pytest.mark.parametrize("to", ["lerobot", "zarr", "ftp1", "univtac"])
def test_every_format_becomes_the_page_of_its_data_set(touched, tmp_path, to):
    options = {"privileged": True} if to != "ftp1" else {}
    exports.export(touched, tmp_path / "out", to, **options)
    wanted, shown = (block(tangere.view(path).html) for path in (touched, tmp_path / "out"))
    assert shown["source"] == str(tmp_path / "out") and shown["shapes"] == wanted["shapes"]
    assert shown["sensors"] == wanted["sensors"] and len(shown["episodes"]) == 2
    moves = to != "ftp1"
    assert ("has no q" in "".join(shown["notes"])) != moves
    for one, other in zip(wanted["episodes"], shown["episodes"], strict=True):
        np.testing.assert_array_equal(numbers(one["time"])[:6], numbers(other["time"])[:6])
        poses, found = (rows_of(e["poses"], 7)[:6] for e in (one, other))
        if moves:
            np.testing.assert_array_equal(poses, found)
        else:
            assert (found == found[0]).all() and np.abs(poses[-1] - found[-1]).max() > 1e-4
        fields, there = (rows_of(e["fields"][0]["values"], 7)[:6] for e in (one, other))
        np.testing.assert_array_equal(fields, there)
        assert np.abs(fields).max() > 0
        if to in ("lerobot", "zarr", "univtac"):
            assert len(other["pictures"][0]["jpeg"]) == 7  # the last frame comes twice
            if to != "univtac":
                assert other["pictures"][0]["jpeg"][:6] == one["pictures"][0]["jpeg"][:6]


def test_scenes_with_other_files_need_no_scene(generate, command, tmp_path):
    """Of <include> the data set has the texts; meshes lie beside the scene of the command."""
    text = tangere.scenes()["rolling_ball_small"].read_text()
    start, end = text.index("<sensor>"), text.index("</sensor>") + len("</sensor>")
    sensors = text[start:end]
    folder = tmp_path / "scene"
    folder.mkdir()
    (folder / "sensors.xml").write_text(f"<tangere><option unit='m-kg'/>{sensors}</tangere>")
    parts = text[:start] + '<include file="sensors.xml"/>' + text[end:]
    (folder / "scene.xml").write_text(parts)
    data = generate(str(folder / "scene.xml"), "--episodes", "1", "--steps", "20", "--every", "10",
                    "--record", "q,pad")  # fmt: skip
    exports.export(data, tmp_path / "out", "zarr", privileged=True)
    shown = block(tangere.view(data).html)["sensors"]
    folder.rename(tmp_path / "gone")
    for path in (data, tmp_path / "out"):
        assert block(tangere.view(path).html)["sensors"] == shown

    with h5py.File(data / "shard-00000.h5", "r+") as file:
        file.attrs["command"] = "tangere generate /dev/zero --episodes 1"
    assert block(tangere.view(data).html)["sensors"] == shown

    (tmp_path / "gone/ball.obj").write_text(OCTAHEDRON)
    body = text.index("<body", text.index('"ball"'))
    mesh = '<body name="ball" type="mesh" filename="ball.obj" transform_type="OBJ_TO_JOINT" '
    mesh += 'pos="0 0 0" quat="1 0 0 0" density="1000"/>'
    own = text[:body] + mesh + text[text.index("/>", body) + 2 :]
    for tag in ("contact", "randomize"):
        own = own[: own.index(f"<{tag}>")] + own[own.index(f"</{tag}>") + len(f"</{tag}>") :]
    (tmp_path / "gone/own.xml").write_text(own)
    data = generate(str(tmp_path / "gone/own.xml"), "--episodes", "1", "--steps", "20", "--every",
                    "10", "--record", "q")  # fmt: skip
    assert any("triangles" in body or "mesh" in str(body)
               for body in block(tangere.view(data).html)["shapes"][0])  # fmt: skip
    (tmp_path / "gone").rename(tmp_path / "away")
    with pytest.raises(tangere.IoError, match="ball.obj.*--scene FILE says beside which file"):
        tangere.view(data)


def test_rewards_and_other_lengths_are_shown(generate, tmp_path):
    data = generate("stable_grasp", "--episodes", "6", "--seed", "3", "--record",
                    "q,v,flow,left_pad")  # fmt: skip
    exports.export(data, tmp_path / "out", "zarr", privileged=True)
    wanted, shown = (block(tangere.view(path).html) for path in (data, tmp_path / "out"))
    lengths = [len(numbers(e["time"])) for e in wanted["episodes"]]
    assert lengths == [len(numbers(e["time"])) for e in shown["episodes"]] and len({*lengths}) > 1
    assert [s["name"] for s in shown["sensors"]] == ["left_pad"]
    for one, other in zip(wanted["episodes"], shown["episodes"], strict=True):
        rewards = [numbers(e["traces"][0]["values"]) for e in (one, other)]
        assert one["traces"][0]["name"] == other["traces"][0]["name"] == "reward"
        np.testing.assert_array_equal(*rewards)


def test_the_command_makes_the_page(pushes, command, tmp_path):
    exports.export(pushes, tmp_path / "out", "zarr", privileged=True)

    def run(*words, python=sys.executable):
        done = subprocess.run(
            [command, "view", tmp_path / "out", "-o", tmp_path / "page.html", *words],
            capture_output=True, text=True, env=os.environ | {"TANGERE_PYTHON": python},
        )  # fmt: skip
        return done.returncode, done.stdout, done.stderr

    code, out, err = run("--episodes", "3", "--json")
    said = json.loads(out)
    page = tmp_path / "page.html"
    assert code == 0 and said["episodes"] == 3 and said["bytes"] == page.stat().st_size, err
    assert said["input"] == str(tmp_path / "out")
    assert said["notes"][0] == "The first 3 of 20 episodes."
    assert block(page.read_text())["notes"] == said["notes"]
    before = page.read_bytes()
    assert run()[0] == 3 and "exists already; expected another name" in run()[2]
    assert page.read_bytes() == before
    code, out, err = run("--overwrite", "--episode", "7")
    assert code == 0 and "1 episodes, 101 frames" in out, err
    assert block(page.read_text())["episodes"][0]["label"] == "episode 7"
    code, _, err = run("--overwrite", "--episode", "20")
    assert code == 2 and "has no episode 20; it has 0 to 19" in err
    assert run("--overwrite", python="no-python")[0] == 3
    assert sorted(p.name for p in tmp_path.iterdir()) == ["out", "page.html"]


@pytest.mark.parametrize("to", ["lerobot", "zarr"])
def test_a_scene_without_sensors_has_a_page(generate, tmp_path, to):
    data = generate(str(tangere.scenes()["ten_boxes"]), "--episodes", "1", "--steps", "20")
    exports.export(data, tmp_path / "out", to, privileged=True, workers=1)
    shown = block(tangere.view(tmp_path / "out").html)
    assert not shown["sensors"] and len(shown["episodes"]) == 1 and shown["shapes"]


def test_what_has_no_scene_is_told(pushes, generate, command, tmp_path):
    exports.export(pushes, tmp_path / "out", "zarr")
    notes = tmp_path / "out/.zattrs"
    said = json.loads(notes.read_text())
    notes.write_text(json.dumps({k: v for k, v in said.items() if k != "scene"}))
    with pytest.raises(tangere.InputError, match="has no scene in .zattrs; expected an export of"):
        tangere.view(tmp_path / "out")
    notes.write_text("{")
    with pytest.raises(tangere.IoError, match="is damaged"):
        tangere.view(tmp_path / "out")
    bare = generate("box_pushing", "--episodes", "1", "--record", "tactile")
    exports.export(bare, tmp_path / "bare", "zarr")
    assert "scene" not in json.loads((tmp_path / "bare/.zattrs").read_text())
    exports.export(pushes, tmp_path / "table.csv", "csv")
    words = [command, "view", tmp_path / "table.csv", "-o", tmp_path / "page.html"]
    done = subprocess.run(words, capture_output=True, text=True)
    assert done.returncode == 2 and "is a table, which has no scene" in done.stderr
