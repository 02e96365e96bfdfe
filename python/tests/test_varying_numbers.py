# SPDX-License-Identifier: Apache-2.0
"""Numbers of environments: drawn together, free to vary, set by name."""

from __future__ import annotations

import pickle

import numpy as np
import pytest

import tangere

FREE = ["contact pad ball kn", "body ball density", "body ball radius", "tactile pad mu"]


@pytest.fixture(scope="module")
def scene():
    return tangere.Scene(tangere.scenes()["rolling_ball_small"])


@pytest.fixture(scope="module")
def free(scene):
    return tangere.Model(scene.vary(FREE))


def drawing(draws: str) -> tangere.Model:
    text = tangere.Scene(tangere.scenes()["rolling_ball_small"]).text
    text = text.replace("</randomize>", draws + "</randomize>")
    return tangere.Model(tangere.Scene.from_string(text))


def played(batch):
    run = batch.run(batch.scene_controls(150), every=150, fields=["pad"])
    return run.q[0], run.fields["pad"][0]


def test_numbers_with_a_tie_are_drawn_together():
    element = '<{} field="mu" {} tie="rubber"/>'
    pair = 'general_primitive_contact general_body="pad" primitive_body="ball"'
    batch = tangere.Batch(
        drawing(
            element.format(pair, 'uniform="0.4 0.8"')
            + element.format('ground_contact body="ball"', 'uniform="0.4 0.8"')
            + element.format('tactile name="pad"', 'uniform="0.8 1.6"')
        ),
        num_envs=20,
    )
    drawn = batch.randomized()
    first = drawn["contact pad ball mu"]
    assert len(set(first)) == 20
    np.testing.assert_array_equal(drawn["ground ball mu"], first)
    np.testing.assert_allclose(drawn["tactile pad mu"], 2 * first, rtol=1e-14)
    batch.set_randomized({"contact pad ball mu": 0.5})  # the tie holds for draws alone
    np.testing.assert_array_equal(batch.randomized()["ground ball mu"], first)
    batch.reset()
    again = batch.randomized()
    np.testing.assert_array_equal(again["ground ball mu"], again["contact pad ball mu"])


@pytest.mark.parametrize("threads", [1, 3])
def test_set_numbers_have_the_bits_of_drawn_ones(free, threads):
    model = drawing(
        '<body name="ball" field="density" uniform="0.8 1.2"/>'
        '<body name="ball" field="radius" uniform="0.019 0.02"/>'
        '<tactile name="pad" field="mu" uniform="1 3"/>'
    )
    expected = tangere.Batch(model, num_envs=20, seed=3, threads=threads)
    drawn = expected.randomized()
    batch = tangere.Batch(free, num_envs=20, seed=3, threads=threads)
    batch.set_randomized({name: drawn[name] for name in FREE[1:]})
    alone = tangere.Batch(free, num_envs=1, seed=3, first_episode=17)
    alone.set_randomized({name: drawn[name][17] for name in FREE[1:]})
    one = played(alone)
    for found, whole, single in zip(played(batch), played(expected), one):
        np.testing.assert_array_equal(found, whole)
        np.testing.assert_array_equal(found[17], single[0])
    assert np.abs(one[1]).max() > 0


def test_numbers_vary_from_the_values_of_the_scene(scene, free):
    plain, batch = (tangere.Batch(m, 3, seed=1) for m in (tangere.Model(scene), free))
    start, drawn = batch.q, plain.randomized()
    assert set(batch.randomized()) == set(drawn) | set(FREE)
    np.testing.assert_array_equal(batch.randomized()["body ball density"], [1, 1, 1])
    np.testing.assert_array_equal(
        batch.randomized()["contact pad ball kn"], drawn["contact pad ball kn"]
    )
    batch.set_randomized({"body ball density": [2, 3], "contact pad ball kn": 5.5}, envs=[2, 0])
    np.testing.assert_array_equal(batch.randomized()["body ball density"], [3, 1, 2])
    kn = batch.randomized()["contact pad ball kn"]
    np.testing.assert_array_equal(kn, [5.5, drawn["contact pad ball kn"][1], 5.5])
    np.testing.assert_array_equal(batch.q, start)
    batch.set_randomized({"body ball density": 4}, envs=np.array([False, True, False]))
    np.testing.assert_array_equal(batch.randomized()["body ball density"], [3, 4, 2])
    batch.reset([0])
    np.testing.assert_array_equal(batch.randomized()["body ball density"], [1, 4, 2])
    assert batch.randomized()["contact pad ball kn"][0] == drawn["contact pad ball kn"][0]


def test_a_field_is_read_with_the_new_numbers(scene, free):
    text = scene.text.replace('kt="0.01" mu="2"', 'kt="0.01" mu="0.02"')
    slippery = tangere.Scene.from_string(text)
    batches = [
        tangere.Batch(model, num_envs=2, seed=1, precision="double")
        for model in (free, tangere.Model(slippery))
    ]
    for batch in batches:
        batch.run(batch.scene_controls(100), every=100)
    before, q = batches[0].tactile("pad"), batches[0].q
    batches[0].set_randomized({"tactile pad mu": [0.02, 2]})
    after, expected = (batch.tactile("pad") for batch in batches)
    np.testing.assert_allclose(after[0], expected[0], rtol=1e-12, atol=1e-18)
    np.testing.assert_array_equal(after[1], before[1])
    assert np.abs(after[0] - before[0]).max() > 1e-6
    np.testing.assert_array_equal(batches[0].q, q)


@pytest.mark.parametrize(
    "values, message",
    [
        ({"contact pad bal kn": 5}, "named 'contact pad bal kn'; did you mean 'contact pad ball"),
        ({"ground ball mu": 1}, r"'ground ball mu' is the same in all .* Scene.vary\(\)"),
        ({"joint ball_joint q[0]": 0}, "is of the starting state"),
        ({"contact pad ball kn": [5, 5]}, r"contact pad ball kn of shape \(2\); expected \(3\)"),
        ({"body ball radius": 0.01, "contact pad ball kn": -1}, 'kn="-1"; expected zero or more'),
        ({"body ball radius": [0.01, 0.01, 0]}, 'environment 2: .* radius="0"; expected a pos'),
        ({"body ball density": np.nan}, "expected a finite number"),
    ],
)
def test_what_cannot_be_set_is_refused(free, values, message):
    batch = tangere.Batch(free, num_envs=3)
    before = batch.randomized()
    with pytest.raises(tangere.InputError, match=message):
        batch.set_randomized(values)
    for name, numbers in batch.randomized().items():
        np.testing.assert_array_equal(numbers, before[name])
    with pytest.raises(tangere.InputError, match="environment 3; expected 0 to 2"):
        batch.set_randomized({"contact pad ball kn": 5}, envs=[3])


def test_a_copy_of_a_scene_varies_as_it_does(scene):
    drawn = ["joint ball_joint q[0]", "joint ball_joint q[1]", "contact pad ball kn"]
    drawn.append("tactile pad kt")
    assert scene.varying == drawn
    more = scene.vary(["body ball radius", "contact pad ball kn", "ground ball mu"])
    assert more.varying == [*drawn, "body ball radius", "ground ball mu"]
    assert more.text == scene.text
    for of in (more, tangere.Scene.from_string(scene.text).vary(["body ball radius"])):
        assert pickle.loads(pickle.dumps(of)).varying == of.varying


def test_what_cannot_vary_is_refused(scene):
    with pytest.raises(tangere.InputError, match="named 'body bal mass'; did you mean"):
        scene.vary(["body bal mass"])
    with pytest.raises(tangere.InputError, match="that may vary is named 'joint ball_joint q"):
        scene.vary(["joint ball_joint q[0]"])
    with pytest.raises(tangere.InputError, match="'body pad size.* varies, but its contact points"):
        tangere.Model(scene.vary(["body pad size[0]"]))
    with pytest.raises(tangere.InputError, match="names 'body ball density'; expected a list"):
        scene.vary("body ball density")


class Masses(tangere.VectorSceneEnv):
    """Every episode has a density of its own."""

    scene = tangere.Scene(tangere.scenes()["rolling_ball_small"]).vary(["body ball density"])
    steps_per_action, horizon = 5, 3

    def restart(self, envs):
        density = self.uniform(envs, 1, 3)
        self.batch.set_randomized({"body ball density": density}, envs=envs)

    def reward(self, actions):
        return self.batch.v[:, 3]


def test_a_task_in_python_sets_the_numbers_of_its_episodes():
    seen = {}
    for envs in (1, 4):
        env = Masses(envs, threads=1, seed=2, autoreset="same_step")
        env.reset()
        for _ in range(env.horizon * (8 // envs)):
            for e, density in enumerate(env.randomized()["body ball density"]):
                assert 1 < density < 3
                assert seen.setdefault(env.episodes[e], density) == density
            env.step(np.zeros(3))
    assert len(set(seen.values())) == 8
    copy = pickle.loads(pickle.dumps(env))
    copy.reset()
    assert copy.randomized()["body ball density"][0] == seen[0]
