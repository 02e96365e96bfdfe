# SPDX-License-Identifier: Apache-2.0
"""Scenes, models and batches: the numbers of C++, as new arrays, and what mistakes say."""

from __future__ import annotations

import gc
import sys
import threading
import warnings

import h5py
import numpy as np
import pytest

import tangere


@pytest.fixture(scope="module")
def model():
    return tangere.Model(tangere.Scene(tangere.scenes()["rolling_ball_small"]))


def test_numbers_are_those_of_a_data_set(model, generate):
    folder = generate(str(tangere.scenes()["rolling_ball_small"]), "--episodes", "3",
                      "--every", "5", "--steps", "200", "--seed", "4")  # fmt: skip
    batch = tangere.Batch(model, num_envs=3, seed=4)
    start = batch.q
    run = batch.run(batch.scene_controls(200), every=5, fields=["pad"])
    with h5py.File(folder / "shard-00000.h5") as file:
        for e in range(3):
            obs = file[f"data/demo_{e}/obs"]
            np.testing.assert_array_equal(obs["q"][0], start[e].astype(np.float32))
            np.testing.assert_array_equal(obs["q"][1:], run.q[:-1, e].astype(np.float32))
            np.testing.assert_array_equal(obs["v"][1:], run.v[:-1, e].astype(np.float32))
            np.testing.assert_array_equal(obs["pad"][1:], run.fields["pad"][:-1, e])
            final = file[f"data/demo_{e}/final_obs/pad"][0]
            np.testing.assert_array_equal(final, run.fields["pad"][-1, e])
    assert np.abs(run.fields["pad"]).max() > 0


def test_a_run_is_its_steps(model):
    one = tangere.Batch(model, num_envs=5, seed=2, threads=1, precision="double")
    many = tangere.Batch(model, num_envs=5, seed=2, threads=3, precision="double")
    u = one.scene_controls(200)
    run = many.run(u, every=100, fields=["pad", "pad.sum", "pad.pressure", "pad.shear"])
    for t in range(200):
        one.step(u[t])
    np.testing.assert_array_equal(run.q[1], one.q)
    np.testing.assert_array_equal(run.v[1], one.v)
    np.testing.assert_array_equal(run.fields["pad"][1], one.tactile("pad"))
    assert run.fields["pad"].dtype == np.float64
    shapes = {name: values.shape for name, values in run.fields.items()}
    assert shapes == {
        "pad": (2, 5, 32, 32, 3),
        "pad.pressure": (2, 5, 32, 32),
        "pad.shear": (2, 5, 32, 32, 2),
        "pad.sum": (2, 5, 6),
    }
    np.testing.assert_array_equal(run.fields["pad.shear"], run.fields["pad"][..., :2])
    pressed = run.fields["pad"][1, ..., 2].sum((1, 2))  # the pad lies level, its third axis is up
    np.testing.assert_allclose(np.abs(run.fields["pad.sum"][1, :, 2]), np.abs(pressed), rtol=1e-9)


def test_a_run_of_some_environments_leaves_the_others(model):
    batch, whole = (tangere.Batch(model, num_envs=11, seed=2) for _ in range(2))
    u = whole.scene_controls(60)
    start, q = batch.q, whole.run(u[:30]).q[-1]
    some = np.array([0, 3, 10])
    others = np.setdiff1d(np.arange(11), some)
    run = batch.run(u[:30], every=30, fields=["pad"], envs=some)
    np.testing.assert_array_equal(run.q[0], batch.q)
    np.testing.assert_array_equal(batch.q[some], q[some])
    np.testing.assert_array_equal(batch.q[others], start[others])
    assert list(batch.counts()["simulation_steps"]) == [30 * (e in some) for e in range(11)]
    assert list(batch.steps) == [30 * (e in some) for e in range(11)]
    batch.run(u[:30], envs=~np.isin(np.arange(11), some))
    np.testing.assert_array_equal(batch.q, q)
    batch.run(u[30:])  # all of them move again, with the state one step before
    np.testing.assert_array_equal(batch.q, whole.run(u[30:]).q[-1])
    with pytest.raises(tangere.InputError, match="environment 11; expected 0 to 10"):
        batch.run(u, envs=[11])


def test_an_episode_is_the_same_in_any_batch(model):
    u = np.array([0.125, 0.0, -0.25])
    wide = tangere.Batch(model, num_envs=20, seed=7)
    alone = tangere.Batch(model, num_envs=1, seed=7, first_episode=18)
    for _ in range(10):
        wide.step(u)
        alone.step(u.astype(np.float32))  # these numbers are the same in both types
    np.testing.assert_array_equal(wide.q[18], alone.q[0])
    again = tangere.Batch(model, num_envs=2, seed=7)
    again.reset(envs=[1], episodes=[18])
    for _ in range(10):
        again.step(u)
    np.testing.assert_array_equal(again.q[1], wide.q[18])
    np.testing.assert_array_equal(again.q[0], wide.q[0])


def test_states_can_be_set(model):
    batch = tangere.Batch(model, num_envs=3)
    q, v = batch.q, batch.v
    q[1, 2] += 0.001
    batch.set_state(q, v)
    np.testing.assert_array_equal(batch.q, q)
    batch.set_state(q[1], v[1], envs=[True, False, False])
    np.testing.assert_array_equal(batch.q, q[[1, 1, 2]])
    batch.set_state(q[0], v[0], envs=[1, 2])
    np.testing.assert_array_equal(batch.q[2], q[0])
    assert batch.q is not batch.q
    q[:] = 0
    assert not np.array_equal(batch.q, q)


def test_views_are_the_state_in_place(model):
    batch = tangere.Batch(model, num_envs=37, seed=5)
    views = {"q": batch.q_view, "v": batch.v_view}
    widths = {"q": model.nq, "v": model.nv}

    def check():
        for name, view in views.items():
            assert view.shape == (3, 16, widths[name]) and view.dtype == np.float64
            rows = view.reshape(48, -1)[:37]
            np.testing.assert_array_equal(rows, getattr(batch, name))
            assert view[2, 3, 1] == getattr(batch, name)[35, 1]
        assert np.isfinite(batch.q).all() and np.isfinite(batch.v).all()

    check()
    first = views["q"].copy()
    batch.run(batch.scene_controls(60), every=60)
    assert (views["q"] != first).any()  # the same memory, other numbers
    check()
    assert np.shares_memory(views["q"], batch.q_view) and np.shares_memory(batch.v_view, views["v"])
    assert not np.shares_memory(views["q"], views["v"])
    assert not np.shares_memory(views["q"], batch.q)
    q = batch.q
    q[36, 0] = 0.25
    batch.set_state(q[36], batch.v[36], envs=[36])
    assert views["q"][2, 4, 0] == 0.25
    batch.reset()
    check()
    np.testing.assert_array_equal(views["q"].reshape(48, -1)[:37], first.reshape(48, -1)[:37])


def test_a_view_can_not_be_written_and_outlives_its_batch(model):
    batch = tangere.Batch(model, num_envs=20, seed=5)
    view, q = batch.q_view, batch.q
    assert not view.flags.writeable
    for write in (lambda: view.__setitem__(0, 1.0), lambda: view.setflags(write=True),
                  lambda: np.add(view, 1, out=view)):  # fmt: skip
        with pytest.raises(ValueError):
            write()
    with pytest.raises(AttributeError):
        batch.q_view = q
    part = view[1, :4, 2]  # a view of the view
    held = sys.getrefcount(batch)
    del view
    gc.collect()
    assert sys.getrefcount(batch) == held  # by the part
    del part
    gc.collect()
    assert sys.getrefcount(batch) == held - 1
    view = batch.q_view
    del batch
    gc.collect()
    others = [tangere.Batch(model, num_envs=20, seed=6) for _ in range(8)]  # in freed memory
    assert (others[0].q != q).any()
    np.testing.assert_array_equal(view.reshape(32, -1)[:20], q)


def test_any_array_of_numbers_is_taken(model):
    batches = [tangere.Batch(model, num_envs=4) for _ in range(4)]
    u = np.linspace(-0.4, 0.4, 12).reshape(4, 3).round(3)
    given = [u, np.asfortranarray(u), u.tolist(), np.repeat(u, 2, axis=1)[:, ::2]]
    for batch, controls in zip(batches, given, strict=True):
        batch.step(controls)
        np.testing.assert_array_equal(batch.q, batches[0].q)


def test_a_field_fills_an_array(model):
    batch = tangere.Batch(model, num_envs=2)
    batch.run(batch.scene_controls(200))
    out = np.full((2, 32, 32, 3), np.nan, np.float32)
    assert batch.tactile("pad", out=out) is out
    np.testing.assert_array_equal(out, batch.tactile("pad"))
    np.testing.assert_array_equal(np.from_dlpack(batch.tactile("pad")), out)
    wrong = r"out of shape \(2, 3\); expected \(2, 32, 32, 3\)"
    with pytest.raises(tangere.InputError, match=wrong):
        batch.tactile("pad", out=np.zeros((2, 3), np.float32))
    with pytest.raises(tangere.InputError, match="float32"):
        batch.tactile("pad", out=np.zeros((2, 32, 32, 3)))


def test_bodies_and_end_effectors(model):
    batch = tangere.Batch(model, num_envs=2)
    pose, twist = batch.bodies()
    assert pose.shape == (2, model.nb, 7) and twist.shape == (2, model.nb, 6)
    np.testing.assert_allclose(np.linalg.norm(pose[..., 3:], axis=-1), 1, atol=1e-12)
    assert batch.end_effectors().shape == (2, len(model.end_effector_names), 3)


def test_mistakes_say_what_was_expected(model, tmp_path):
    batch = tangere.Batch(model, num_envs=2)
    for call, message in [
        (lambda: batch.step(np.zeros((2, 2))), r"controls of shape \(2, 2\); expected \(2, 3\)"),
        (lambda: batch.step(np.zeros(4)), r"controls of shape \(4\); expected \(3\)"),
        (lambda: batch.run(np.zeros((5, 2, 3)), every=2), "5 steps with a frame every 2"),
        (lambda: batch.tactile("pda"), "no reading is named 'pda'; expected one of: pad"),
        (lambda: batch.reset(envs=[2]), "environment 2; expected 0 to 1"),
        (lambda: batch.reset(episodes=[1]), "1 episodes for 2 environments"),
        (lambda: batch.reset(envs=[True]), "a mask of 1 environments; expected 2"),
        (lambda: batch.reset(envs=[0.5]), "expected indices"),
        (lambda: batch.run(np.zeros((2, 2, 3)), fields=["pad", "pad"]), "'pad' is listed twice"),
        (lambda: batch.set_state(np.full(model.nq, np.nan), np.zeros(model.nv)), "not finite"),
        (lambda: batch.set_state(np.zeros(model.nq), np.zeros(model.nv)), "unit quaternion"),
        (lambda: model.mass(model.nb), f"body {model.nb}; expected 0 to {model.nb - 1}"),
        (lambda: model.mass(-1), "body -1"),
        (lambda: tangere.Batch(model, num_envs=0), "0 environments"),
        (lambda: tangere.Batch(model, threads=0), "0 threads"),
        (lambda: tangere.Batch(model, precision="half"), "precision 'half'"),
        (lambda: tangere.task_spec("box_pushin"), "no task is named 'box_pushin'"),
        (lambda: tangere.Scene.from_string("<tangere><robo/></tangere>", "a.xml"), "a.xml:1"),
    ]:
        with pytest.raises(tangere.InputError, match=message):
            call()
    assert issubclass(tangere.InputError, ValueError) and issubclass(tangere.IoError, OSError)
    with pytest.raises(OSError, match="absent.xml"):
        tangere.Scene(tmp_path / "absent.xml")
    for nonsense in ("fast", [[1, 2], [3]], np.array([1j, 0, 0]), [None, 0, 1]):
        with pytest.raises(TypeError):
            batch.step(nonsense)


def test_what_a_scene_reader_overlooks_is_a_warning(model):
    text = model.scene.text.replace("<ground ", '<ground colour="red" ', 1)
    path = tangere.scenes()["rolling_ball_small"].parent
    assert "colour" in text and path.is_dir()
    with pytest.raises(tangere.InputError, match="colour"):
        tangere.Scene.from_string(text)


def test_a_failed_environment_is_told(model):
    batch = tangere.Batch(model, num_envs=2)
    u = np.zeros((2, 3))
    u[1, 0] = np.nan
    batch.step(u)
    assert batch.status.tolist() == [0, -2]
    assert tangere.StepStatus(batch.status[1]) is tangere.StepStatus.non_finite == -2
    assert batch.run(np.zeros((1, 2, 3))).status.tolist() == [0, -2]
    batch.set_state(batch.q, batch.v)
    assert batch.status.tolist() == [0, 0]


def test_steps_are_counted_by_their_status(model):
    one = tangere.Batch(model, num_envs=20, seed=1, threads=1)
    many = tangere.Batch(model, num_envs=20, seed=1, threads=2)
    u = np.random.default_rng(0).uniform(-1, 0.3, (150, 20, 3))
    u[100:, 4] = np.nan
    named = {"damped_steps": "damped", "split_steps": "split", "overlapping_steps": "overlapping"}
    by_status = {name: np.zeros(20, np.int64) for name in named}
    many.run(u, every=150)
    for controls in u:
        one.step(controls)
        for name, status in named.items():
            by_status[name] += one.status == getattr(tangere.StepStatus, status)
    for name, wanted in by_status.items():
        np.testing.assert_array_equal(many.counts()[name], wanted)
        np.testing.assert_array_equal(one.counts()[name], wanted)
    assert by_status["damped_steps"].max() > 0 and many.status[4] < 0
    np.testing.assert_array_equal(many.counts()["simulation_steps"], many.steps)
    assert many.steps[4] == 100 and many.counts()["newton_iterations"].min() >= 100
    many.reset([3], [7])
    zero = {name: int(counts[3]) for name, counts in many.counts().items()}
    assert set(zero.values()) == {0} and many.counts()["simulation_steps"][5] == 150


def test_the_gil_is_free_and_one_thread_has_the_batch(model):
    batch = tangere.Batch(model, num_envs=64, threads=1)
    u = batch.scene_controls(300)
    refused = []
    runner = threading.Thread(target=batch.run, args=(u,))
    runner.start()
    while runner.is_alive():  # this loop runs only because run() has let the interpreter go
        try:
            batch.status
        except tangere.InputError as error:
            refused.append(str(error))
            break
    runner.join()
    assert refused and "in use by another thread" in refused[0]
    batch.step(np.zeros(3))


def test_everything_has_a_docstring():
    for name in ("Scene", "Model", "Batch", "Environments", "TaskSpec", "TensorSpec", "Sensor"):
        kind = getattr(tangere, name)
        assert kind.__doc__
        for method in vars(kind):
            if not method.startswith("_") and callable(getattr(kind, method)):
                assert getattr(kind, method).__doc__.count("\n") > 0, f"{name}.{method}"


def test_no_warning_on_the_scenes_that_come_along():
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        for path in tangere.scenes().values():
            tangere.Model(tangere.Scene(path))


def test_steps_are_cut_to_keep_an_accuracy(model):
    whole, cut = (tangere.Batch(model, timestep=0.025, accuracy=x) for x in (0, 1e-4))
    fine = tangere.Batch(model, timestep=0.0025, accuracy=1e-5)
    for batch, steps in ((whole, 30), (cut, 30), (fine, 300)):
        for _ in range(steps):
            batch.step(np.array([0.0, 0.0, 0.2]))
    assert np.abs(cut.q - fine.q).max() < 0.05 * np.abs(whole.q - fine.q).max()
    with pytest.raises(tangere.InputError, match="below 1"):
        tangere.Batch(model, accuracy=2)


def test_what_friction_remembers_goes_on():
    model = tangere.Model(tangere.Scene(tangere.scenes()["box_pushing_elastic"]))
    points = model.shear_state_arrays
    assert {name: places.shape for name, places in points.items()} == {
        "contact pad box": (66, 3),
        "ground box": (8, 3),
        "tactile pad box_carriage": (130, 3),
        "tactile pad box": (130, 3),
    }
    pad = points["tactile pad box"].reshape(13, 10, 3)  # in the order of the field
    down = pad[1, 0] - pad[0, 0]  # rows go up the finger, 1.5 mm apart
    np.testing.assert_allclose(down, [0, 0, 0.0015], atol=1e-12)
    np.testing.assert_allclose(np.diff(pad, axis=0), np.full((12, 10, 3), down), atol=1e-12)
    batch = tangere.Batch(model, num_envs=19, seed=3, precision="double")
    assert batch.shear_state.shape == (19, 334, 3) and not batch.shear_state.any()
    u = batch.scene_controls(120)
    batch.run(u[:90])
    middle = batch.q, batch.v, batch.shear_state
    touched = middle[2][:, -130:].any(axis=-1)
    assert touched.any(axis=1).all() and not touched.all()
    felt = np.linalg.norm(batch.tactile("pad"), axis=-1).reshape(19, 130)
    assert (felt[touched] > 0).all()
    whole = batch.run(u[90:], fields=["pad"])
    end = batch.shear_state
    other = tangere.Batch(model, num_envs=19, seed=3, precision="double")
    q, v, memory = middle
    other.set_state(q, v)
    other.set_shear_state(memory)
    np.testing.assert_array_equal(other.shear_state, memory)
    again = other.run(u[90:], fields=["pad"])  # BDF1 has no state before
    np.testing.assert_array_equal(again.q, whole.q)
    np.testing.assert_array_equal(again.fields["pad"], whole.fields["pad"])
    np.testing.assert_array_equal(other.shear_state, end)
    other.set_shear_state(memory[4], envs=[1, 2])
    changed = end[:1].tolist() + [memory[4]] * 2 + [*end[3:]]
    np.testing.assert_array_equal(other.shear_state, changed)
    other.reset(envs=[1])
    assert not other.shear_state[1].any() and other.shear_state[2].any()
    assert other.steps[1] == 0 and other.steps[2] == 30 and other.steps.dtype == np.int64
    other.set_steps(batch.steps)
    np.testing.assert_array_equal(other.steps, 19 * [120])
    other.set_steps([7], envs=[3])
    assert other.steps[3] == 7 and other.steps[4] == 120
    for steps, message in [([1, 2], "2 numbers of steps for 19"), ([-1] * 19, "-1 steps")]:
        with pytest.raises(tangere.InputError, match=message):
            other.set_steps(steps)
    for wrong, message in [
        (memory[:, :-1], r"shear_state of shape \(19, 333, 3\); expected \(19, 334, 3\)"),
        (memory[0, :, :2], r"shear_state of shape \(334, 2\); expected \(334, 3\)"),
        (np.full((334, 3), np.inf), "not finite"),
    ]:
        with pytest.raises(tangere.InputError, match=message):
            other.set_shear_state(wrong)


def test_a_scene_without_springs_has_no_memory(model):
    assert model.shear_state_arrays == {} and "memory" not in model.readings
    assert tangere.Batch(model, num_envs=2).shear_state.shape == (2, 0, 3)


@pytest.mark.parametrize(
    "call, said",
    [
        (lambda b, m: b.reset(1), r"envs of shape \(\); expected a list of .*, or a mask \(3\)"),
        (lambda b, m: b.reset(np.array(1)), r"envs of shape \(\)"),
        (lambda b, m: b.set_state(b.q, b.v, [[0, 1]]), r"envs of shape \(1, 2\)"),
        (lambda b, m: b.set_state(b.q, b.v, np.int64(2)), r"envs of shape \(\)"),
        (lambda b, m: b.reset([2**31]), "environment 2147483648; expected a whole number from"),
        (lambda b, m: b.reset([0], [2**64]), "episode 18446744073709551616; expected"),
        (lambda b, m: b.set_steps([2**70, 0, 0]), "steps 1180591620717411303424; expected"),
        (lambda b, m: b.run(np.zeros((4, 3, m.nu)), every=2**40), "every 1099511627776; expected"),
        (lambda b, m: b.scene_controls(10**12), r"no memory for an array \(1000000000000, 3, 3\)"),
        (lambda b, m: b.scene_controls(10**30), "steps 10{30}; expected"),
        (lambda b, m: m.mass(2**40), "body 1099511627776; expected"),
        (lambda b, m: tangere.Batch(m, num_envs=2**31), "envs 2147483648; expected"),
        (lambda b, m: tangere.Batch(m, seed=-1), "seed -1; expected a whole number from 0 to"),
        (lambda b, m: tangere.Batch(m, threads=2**33), "threads 8589934592; expected"),
        (lambda b, m: tangere.make_vec("box_pushing", 2**40), "envs 1099511627776; expected"),
    ],
)
def test_numbers_that_do_not_fit_are_told_in_one_line(model, call, said):
    with pytest.raises(tangere.InputError, match=said) as error:
        call(tangere.Batch(model, num_envs=3), model)
    assert "\n" not in str(error.value)


def test_whole_numbers_of_numpy_count(model):
    numbers = dict(num_envs=np.int32(2), seed=np.uint64(2**64 - 1), threads=np.int8(1))
    batch = tangere.Batch(model, **numbers)
    assert (batch.num_envs, batch.seed) == (2, 2**64 - 1)
    with pytest.raises(TypeError):
        tangere.Batch(model, num_envs=2.0)


def test_faces_bound_the_bodies():
    """Volumes by the divergence theorem; the square of the ground."""
    shapes = {
        "cuboid": ('size="0.1 0.2 0.3"', 0.006, 1e-12),
        "sphere": ('radius="0.1"', 4 / 3 * np.pi * 1e-3, 0.03),
        "cylinder": ('radius="0.1" length="0.2"', np.pi * 2e-3, 0.03),
        "capsule": ('radius="0.1" length="0.2"', np.pi * 2e-3 + 4 / 3 * np.pi * 1e-3, 0.03),
        "ellipsoid": ('size="0.2 0.4 0.6"', 4 / 3 * np.pi * 6e-3, 0.03),
    }
    links = "".join(
        f'<link name="{kind}"><joint name="{kind}" type="free3d" pos="{k} 0 1"/>'
        f'<body name="{kind}" type="{kind}" {size} density="1000" rgba="0.1 0.2 0.3 1"/></link>'
        for k, (kind, (size, _, _)) in enumerate(shapes.items())
    )
    text = (
        '<tangere><option unit="m-kg" timestep="1e-3" integrator="BDF1"/>'
        f'<ground pos="0 0 0.5" normal="0 0 1"/><robot>{links}</robot></tangere>'
    )
    batch = tangere.Batch(tangere.Model(tangere.Scene.from_string(text)), num_envs=2)
    corners, body, rgba = batch.faces(1, half_space=2)
    assert corners.shape[1:] == (3, 3) and body.dtype == np.int32
    for k, (kind, (_, volume, error)) in enumerate(shapes.items()):
        a, b, c = np.moveaxis(corners[body == k], 1, 0)
        assert (a * np.cross(b, c)).sum() / 6 == pytest.approx(volume, rel=error), kind
        np.testing.assert_array_equal(rgba[body == k], [[0.1, 0.2, 0.3, 1]] * len(a))
    ground = corners[body == -1]
    assert ground[..., :2].max() == 2 and (ground[..., 2] == 0.5).all()
    assert np.cross(ground[0, 1] - ground[0, 0], ground[0, 2] - ground[0, 0])[2] > 0
    for wrong in ((2, 0), (-1, 0), (0, -1), (0, np.inf)):
        with pytest.raises(tangere.InputError, match="expected 0"):
            batch.faces(*wrong)


def test_faces_have_the_sizes_that_an_episode_drew():
    env = tangere.make_vec("cap_opening", 2, threads=1)
    env.reset(seed=1)
    radii = env.randomized()["body cap radius"]
    assert radii[0] != radii[1]
    cap = env.model.body_names.index("cap")
    for e in range(2):
        corners, body, _ = env._env.faces(e)
        found = np.linalg.norm(corners[body == cap][..., :2], axis=-1).max()
        assert found == pytest.approx(radii[e], rel=1e-12)


def test_transmissions_have_forces() -> None:
    b = tangere.SceneBuilder()
    b.option(gravity=(0, 0, 0), timestep=1e-3)
    ball = b.robot.link("ball")
    ball.joint("ball", "prismatic", axis=(1, 0, 0))
    ball.body("sphere", radius=0.05, density=1000)
    cord = b.robot.link("cord")
    cord.joint("cord", "prismatic", axis=(1, 0, 0), stiffness=80, rest=0.25, damping=0.4)
    cord.body("abstract", mass=0, inertia=(0, 0, 0))
    path = b.transmission.path("cord")
    path.point(body="ball")
    path.point(pos=(0, 0.3, 0))
    b.actuator.motor("cord", "force", ctrl_range=(-2, 2))
    model = tangere.Model(b.scene())
    assert model.transmission_names == ["cord"] and "transmissions" in model.readings
    batch = tangere.Batch(model, num_envs=3)
    u = np.array([[0.1], [0.2], [-0.3]])
    batch.step(u)
    (length, rate), force = (batch.q[:, 1], batch.v[:, 1]), batch.transmission_forces(u)
    assert force.shape == (3, 1)
    expected = 80 * (0.25 - length) - 0.4 * rate + 2 * u[:, 0]
    np.testing.assert_allclose(force[:, 0], expected, atol=1e-12)
