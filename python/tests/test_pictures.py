# SPDX-License-Identifier: Apache-2.0
"""Pictures of gels: arrays of a batch, data sets, gradients."""

from __future__ import annotations

import subprocess
from pathlib import Path

import h5py
import numpy as np
import pytest

import tangere
from tangere.data import Episodes

GEL = tangere.scenes()["gel_press"]
VARIES = '<tactile name="gel" field="kn" uniform="2e8 3e8"/>'
READINGS = ["gel.height", "gel.rgb", "gel.rgb_marker"]


def scene_text(picture: str, layer: bool = True) -> str:
    """Returns the press with a picture, a constant kn, and the layer or springs."""
    text = Path(GEL).read_text().replace(VARIES, "")
    old = '<layer cell="0.75e-3" margin="1e-3"/>'
    assert old in text
    return text.replace(old, (old if layer else "") + "<markers/>" + picture)


def scene(picture: str = '<picture rows="24" cols="32" markers="4 3"/>', layer: bool = True):
    text = scene_text(picture, layer)
    if not layer:
        text = text.replace("<markers/>", '<markers stiffness="50"/>')
    return tangere.Scene.from_string(text, str(GEL))


def pressed(of, envs: int = 2):
    """Returns a batch after steps in which each environment is pressed deeper than the last."""
    batch = tangere.Batch(of, envs, seed=1)
    u = np.zeros((60, envs, 3))
    u[:, :, 2] = -0.001 - 0.0003 * np.arange(envs)
    return batch, batch.run(u, every=60, fields=READINGS)


@pytest.mark.parametrize("layer", [True, False])
def test_arrays_have_the_shape_and_type_of_pictures(layer):
    batch, run = pressed(tangere.Model(scene(layer=layer)))
    height, rgb, marked = (batch.tactile(name) for name in READINGS)
    assert (height.shape, height.dtype) == ((2, 24, 32, 1), np.float32)
    assert (rgb.shape, rgb.dtype) == ((2, 24, 32, 3), np.uint8)
    assert height[1].max() > height[0].max() > 1e-4
    assert rgb[1].std() > rgb[0].std() > 0 and marked.mean() < rgb.mean() - 1
    for name, picture in zip(READINGS, (height, rgb, marked)):
        np.testing.assert_array_equal(run.fields[name][0], picture)
    out = np.empty_like(rgb)
    assert batch.tactile("gel.rgb", out=out) is out
    np.testing.assert_array_equal(out, rgb)
    with pytest.raises(tangere.InputError, match="array of uint8"):
        batch.tactile("gel.rgb", out=np.empty(rgb.shape))


def test_a_sensor_without_pictures_says_so():
    with pytest.raises(tangere.InputError, match="reading 'gel.rgb': .*has no <picture>"):
        tangere.Batch(tangere.Model(scene("")), 1).tactile("gel.rgb")


@pytest.mark.parametrize("compress", ["none", "deflate"])
def test_data_sets_have_bytes(command, tmp_path, compress):
    press = tmp_path / "press.xml"
    press.write_text(scene_text('<picture rows="24" cols="32" noise="1"/>'))
    folder = tmp_path / "set"
    subprocess.run(
        [command, "generate", press, "-o", folder, "--episodes", "3", "--every", "25", "--seed",
         "4", "--record", "q,gel.rgb,gel.height/100", "--compress", compress],
        check=True, capture_output=True)  # fmt: skip
    subprocess.run([command, "validate", folder], check=True, capture_output=True)
    with h5py.File(next(folder.glob("*.h5"))) as shard:
        demo = shard["data/demo_1"]
        rgb = demo["obs/gel.rgb"]
        assert rgb.dtype == np.uint8 and rgb.shape[1:] == (24, 32, 3)
        assert demo["samples/gel.height"].dtype == np.float32
        facts = shard["scene/sensors/gel"].attrs
        assert facts["picture_gel"] == "default" and facts["picture_noise"] == 1.0
        pictures = rgb[:]
    episodes = Episodes(folder)
    np.testing.assert_array_equal(episodes[1]["gel.rgb"], pictures)


def test_the_material_of_a_layer_may_be_the_only_parameter():
    torch = pytest.importorskip("torch", reason="PyTorch is not installed")
    import tangere.torch as tt

    text = Path(GEL).read_text().replace(VARIES, "")
    sim = tt.Simulation(tangere.Scene.from_string(text), 1, 60, every=60, read=["gel"], threads=1)
    numbers = sim.parameters("tactile gel thickness", "tactile gel poisson")
    for value in numbers.values():
        value.requires_grad_(True)
    u = torch.tensor([[0.0, 0.0, -0.001]], dtype=torch.float64)
    sim.step(sim.reset(parameters=numbers), u)["gel"].sum().backward()
    assert all(value.grad.abs().max() > 0 for value in numbers.values())


@pytest.mark.parametrize("layer", [True, False])
def test_gradients_agree_with_differences(layer):
    torch = pytest.importorskip("torch", reason="PyTorch is not installed")
    import tangere.torch as tt

    sim = tt.Simulation(
        scene(layer=layer), 1, 60, every=60, read=READINGS, threads=1
    )
    rows = torch.linspace(-1, 1, 24, dtype=torch.float64)[:, None, None]
    cols = torch.linspace(-1, 1, 32, dtype=torch.float64)[:, None]

    def loss(u):
        s = sim.step(sim.reset(seed=3), u)
        assert s["gel.rgb"].shape == (1, 24, 32, 3)
        marked = (s["gel.rgb_marker"] * cols).sum()
        return marked + (s["gel.rgb"] * rows).sum() + 1e5 * (s["gel.height"] * (1 + rows)).sum()

    u = torch.tensor([[2e-4, 1e-4, -0.001]], dtype=torch.float64, requires_grad=True)
    loss(u).backward()
    along = torch.tensor([[3e-5, -2e-5, -1e-4]], dtype=torch.float64)
    expected = float((u.grad * along).sum())
    errors = []
    for step in (1e-1, 3e-2, 1e-2):  # pictures of springs are computed in single precision
        with torch.no_grad():
            sides = [loss(u + sign * step * along) for sign in (1, -1)]
        errors.append(abs(float(sides[0] - sides[1]) / (2 * step) / expected - 1))
    assert min(errors) < (5e-3 if layer else 1e-2), errors
