# SPDX-License-Identifier: Apache-2.0
"""What the hardware of a sensor returns: arrays, flaws, names, gradients."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
import tangere

MAP = """<channels nodes="1 2" loads="pressure" unit="uT">
  <channel name="bx" offset="3" linear="-20 30" quadratic="4 0 -7"/>
  <channel name="bz" offset="-5" linear="15 25" quadratic="0 6 0"/>
</channels>
"""


def scene_with(folder, flaws=""):
    """Returns the path of the small rolling ball, whose pad has channels."""
    text = Path(tangere.scenes()["rolling_ball_small"]).read_text()
    at = text.index("/>", text.index("<tactile name"))
    part = f'><channels file="map.xml" {flaws}/></tactile>'
    (folder / "map.xml").write_text(MAP)
    path = folder / "scene.xml"
    path.write_text(text[:at] + part + text[at + 2 :])
    return str(path)


def pressed(model, seed=0):
    batch = tangere.Batch(model, 3, seed=seed, precision="double")
    for _ in range(40):
        batch.step(np.tile([0.0, 0.0, -0.3], (3, 1)))
    return batch


def expected(field):
    """(E, 2) by the equation of the page."""
    load = field[..., 2] * np.sign(field[..., 2].sum())  # points of a damped skin may pull
    right = np.linspace(0, 1, field.shape[2])
    a, b = (load * (1 - right)).sum((1, 2)), (load * right).sum((1, 2))
    bx = 3 - 20 * a + 30 * b + 4 * a * a - 7 * b * b
    return np.stack([bx, -5 + 15 * a + 25 * b + 6 * a * b], 1)


def test_channels_follow_the_field(tmp_path):
    batch = pressed(tangere.Model(tangere.Scene(scene_with(tmp_path))))
    found = batch.tactile("pad.channels")
    assert found.shape == (3, 2)
    field = batch.tactile("pad")
    assert np.abs(field).max() > 0
    np.testing.assert_allclose(found, expected(field), rtol=1e-12)


def test_flaws_are_seeded(tmp_path):
    noisy = tangere.Model(tangere.Scene(scene_with(tmp_path, 'noise="2" quantisation="0.5"')))
    one, two = pressed(noisy).tactile("pad.channels"), pressed(noisy).tactile("pad.channels")
    np.testing.assert_array_equal(one, two)
    assert not np.array_equal(one, pressed(noisy, seed=5).tactile("pad.channels"))
    np.testing.assert_array_equal(one, 0.5 * np.round(one / 0.5))
    ideal = pressed(tangere.Model(tangere.Scene(scene_with(tmp_path)))).tactile("pad.channels")
    assert 0 < np.abs(one - ideal).max() < 15


def test_a_sensor_without_channels_says_so():
    batch = tangere.Batch(tangere.Model(tangere.Scene(tangere.scenes()["rolling_ball_small"])), 1)
    with pytest.raises(tangere.InputError, match="has no <channels>"):
        batch.tactile("pad.channels")


def test_gradients_agree_with_differences(tmp_path):
    jax = pytest.importorskip("jax", reason="JAX is not installed")
    jax.config.update("jax_enable_x64", True)
    import jax.numpy as jnp
    import tangere.jax as tj

    sim = tj.Simulation(scene_with(tmp_path), 1, 40, every=20, read=["pad.channels"], threads=1)

    def loss(u):
        s = sim.reset(seed=1)
        for t in range(2):
            s = sim.step(s, u[t])
        return (s["pad.channels"] * jnp.array([1.0, -2.0])).sum()

    u = jnp.array([[[0.1, 0.0, -0.3]], [[0.0, 0.1, -0.2]]])
    value, bar = jax.value_and_grad(loss)(u)
    way = np.random.default_rng(2).standard_normal(u.shape)
    e = 1e-5
    slope = (loss(u + e * way) - loss(u - e * way)) / (2 * e)
    assert np.isfinite(value) and abs(slope) > 1e-6
    np.testing.assert_allclose((bar * way).sum(), slope, rtol=1e-5)
