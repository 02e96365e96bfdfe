# SPDX-License-Identifier: Apache-2.0
"""Rollouts in one call, and pages on which they move."""

from __future__ import annotations

import base64
import html
import json
import re

import numpy as np
import pytest

import tangere


def rolled(envs=3, **options):
    model = tangere.Model(tangere.Scene(tangere.scenes()["grip_rod"]))
    q, v = model.initial_q, np.zeros((envs, model.nv))
    return tangere.rollout(
        model, q, v, np.tile([0.0, 0.8, 0.8], (40, 1)), every=10, read=["left_finger"], **options
    )


def data(page):
    block = re.search(r'<script type="application/json"[^>]*>(.*?)</script>', page.html, re.DOTALL)
    assert block, page.html[:300]
    return json.loads(block.group(1))


def numbers(array):
    return np.frombuffer(base64.b64decode(array["base64"]), np.float32)


def test_a_rollout_has_the_bits_of_a_batch():
    run = rolled()
    assert run.q.shape == (4, 3, 10) and run.fields["left_finger"].shape == (4, 3, 20, 20, 3)
    model = tangere.Model(tangere.Scene(tangere.scenes()["grip_rod"]))
    batch = tangere.Batch(model, 3)
    for _ in range(40):
        batch.step([0.0, 0.8, 0.8])
    np.testing.assert_array_equal(run.q[-1], batch.q)
    np.testing.assert_array_equal(run.fields["left_finger"][-1], batch.tactile("left_finger"))
    assert np.abs(batch.tactile("left_finger")).max() > 0


def test_shapes_that_do_not_fit_are_refused():
    file = tangere.scenes()["grip_rod"]
    model = tangere.Model(tangere.Scene(file))
    q, v, u = model.initial_q, np.zeros(model.nv), np.zeros((4, 3))
    assert tangere.rollout(file, q, v, u).q.shape == (4, 1, 10)
    with pytest.raises(tangere.InputError, match="q has 2, v has 3; expected one number"):
        tangere.rollout(model, np.tile(q, (2, 1)), np.zeros((3, model.nv)), u)
    with pytest.raises(tangere.InputError, match=r"v of shape \(3,\); expected \(1, 9\)"):
        tangere.rollout(model, q, np.zeros(3), u)
    with pytest.raises(tangere.InputError, match=r"controls of shape \(4, 1, 2\)"):
        tangere.rollout(model, q, v, u[:, :2])


def test_a_run_becomes_a_page(tmp_path):
    run = rolled()
    page = tangere.view(run, envs=[2, 0], height=300)
    shown = data(page)
    assert [e["label"] for e in shown["episodes"]] == ["environment 2", "environment 0"]
    assert [s["name"] for s in shown["sensors"]] == ["left_finger"]
    times = numbers(shown["episodes"][0]["time"])
    np.testing.assert_allclose(times, [0.02, 0.04, 0.06, 0.08], rtol=1e-6)
    text = page._repr_html_()
    assert text.startswith("<iframe") and 'height="300"' in text
    assert html.unescape(re.search(r'srcdoc="(.*?)" width', text, re.DOTALL)[1]) == page.html
    assert page.save(tmp_path / "run.html").read_text() == page.html
    with pytest.raises(tangere.InputError, match=r"envs \[3\]; expected some of 0 to 2"):
        tangere.view(run, envs=[3])
    with pytest.raises(tangere.IoError):
        tangere.view(tmp_path / "run.html")
    with pytest.raises(tangere.InputError, match="type Model; expected what Batch.run"):
        tangere.view(run.model)


def test_a_data_set_becomes_a_page(generate):
    folder = generate("ball_rolling_small", "--episodes", "2")
    assert len(data(tangere.view(folder))["episodes"]) == 2
