# SPDX-License-Identifier: Apache-2.0
"""Sensors whose points a layer couples, or whose pressures a table gives: readings, gradients."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

torch = pytest.importorskip("torch", reason="PyTorch is not installed")

import tangere  # noqa: E402
import tangere.torch as tt  # noqa: E402

GEL = tangere.scenes()["gel_press"]
TABLE = 'pressure_depth="0 5e-4 1e-3 2e-3" pressure="0 1e5 1.5e5 6e5" thickness="4e-3"'


def with_table(folder):
    """Returns the path of the same press with a table in place of the layer."""
    text = Path(GEL).read_text()
    for old, new in (('modulus="4.28e5" thickness="4e-3"', TABLE),
                     ('<layer cell="0.75e-3" margin="1e-3"/>', "")):  # fmt: skip
        assert old in text
        text = text.replace(old, new)
    path = folder / "table.xml"
    path.write_text(text)
    return str(path)


def test_environments_have_gels_of_their_own():
    sim = tt.Simulation(GEL, 3, 60, every=60, read=["gel", "gel.sum"])
    with torch.no_grad():
        s = sim.step(sim.reset(seed=1), torch.zeros(3, 3).index_fill(1, torch.tensor([2]), -0.0015))
    field, total = s["gel"].numpy(), s["gel.sum"].numpy()
    assert field.shape == (3, 48, 64, 3)
    np.testing.assert_allclose(field[..., 2].sum((1, 2)), np.abs(total[:, 2]), rtol=1e-9)
    assert len(np.unique(field[..., 2].max((1, 2)))) == 3  # kn is drawn, and E follows it


def test_loads_of_the_contact_do_not_follow_the_gel():
    text = Path(GEL).read_text()
    old = '<layer cell="0.75e-3" margin="1e-3"/>'
    assert old in text
    text = text.replace(old, old.replace("/>", ' load="contact"/>'))
    batch = tangere.Batch(tangere.Model(tangere.Scene.from_string(text)), 3, 1, precision="double")
    for _ in range(60):
        batch.step(np.array([0, 0, -0.0015]))
    field = batch.tactile("gel")[..., 2]
    total = field.sum((1, 2))
    assert total[0] > 1
    np.testing.assert_allclose(total, total[0], rtol=1e-12)  # of one motion
    assert len(np.unique(field.max((1, 2)))) == 3  # kn is drawn, and E follows it
    assert batch.loads_not_carried == 0


@pytest.mark.parametrize("table", [False, True])
def test_gradients_agree_with_differences(table, tmp_path):
    scene = with_table(tmp_path) if table else GEL
    sim = tt.Simulation(scene, 2, 60, every=20, read=["gel"], threads=1)
    draw = torch.Generator().manual_seed(1)
    weights = torch.randn(3, generator=draw, dtype=torch.float64)
    name = "tactile gel kn"

    def loss(u, kn):
        s, total = sim.reset(seed=3, parameters={name: kn}), 0
        for t in range(3):
            s = sim.step(s, u[t])
            total = total + (s["gel"] * weights).sum()
        return total

    kn = sim.parameters(name)[name].detach().clone().requires_grad_()
    u = torch.zeros(3, 2, 3, dtype=torch.float64)
    u[:, :, 2] = torch.tensor([[-0.0005], [-0.001], [-0.0013]], dtype=torch.float64)
    u.requires_grad_()
    loss(u, kn).backward()
    for x, size in ((u, 1e-4), (kn, 0.1 * float(kn.detach().max()))):
        along = size * torch.randn(x.shape, generator=draw, dtype=torch.float64)
        expected = float((x.grad * along).sum())
        assert abs(expected) > 1e-6
        errors = []
        for step in (1e-2, 1e-3, 1e-4, 1e-5):  # points begin to press, which large steps cross
            with torch.no_grad():
                sides = [loss(*(y + sign * step * along if y is x else y for y in (u, kn)))
                         for sign in (1, -1)]  # fmt: skip
            errors.append(abs(float(sides[0] - sides[1]) / (2 * step) / expected - 1))
        assert min(errors) < 1e-4, errors


def test_the_surface_moves_with_gradients():
    text = GEL.read_text().replace("/>\n    </tactile>", "/><markers/>\n    </tactile>")
    varies = '<tactile name="gel" field="kn" uniform="2e8 3e8"/>'
    assert "<markers/>" in text and varies in text
    with pytest.raises(tangere.InputError, match="its kn varies"):
        tangere.Model(tangere.Scene.from_string(text, str(GEL)))
    scene = tangere.Scene.from_string(text.replace(varies, ""), str(GEL))
    sim = tt.Simulation(scene, 1, 60, every=60, read=["gel.surface", "gel.markers"], threads=1)
    draw = torch.Generator().manual_seed(2)
    weights = torch.randn(48, 64, 3, generator=draw, dtype=torch.float64)

    def surface(u):
        s = sim.step(sim.reset(seed=3), u)
        assert torch.equal(s["gel.markers"], s["gel.surface"][..., :2])
        return s["gel.surface"]

    u = torch.zeros(1, 3, dtype=torch.float64).index_fill(1, torch.tensor([2]), -0.0013)
    u.requires_grad_()
    moved = surface(u)
    assert moved[..., 2].min() < -1e-4 and moved[..., 2].max() > 0  # down beneath the ball, and up
    (1e4 * (moved * weights).sum()).backward()
    errors = []
    for step in (1e-6, 1e-7, 1e-8):
        with torch.no_grad():
            sides = [(1e4 * (surface(u + sign * step * torch.eye(3)[2:]) * weights).sum())
                     for sign in (1, -1)]  # fmt: skip
        errors.append(abs(float(sides[0] - sides[1]) / (2 * step) / float(u.grad[0, 2]) - 1))
    assert min(errors) < 1e-4, errors


def test_the_builder_has_layers():
    builder = tangere.SceneBuilder.from_file(GEL)
    xml = builder.xml()
    assert "<layer" in xml and "modulus" in xml
    with pytest.raises(tangere.InputError, match="at most a third of the thickness"):
        tangere.Model(tangere.SceneBuilder.from_string(
            xml.replace('thickness="4e-3"', 'thickness="4e-4"'), GEL).scene())  # fmt: skip
