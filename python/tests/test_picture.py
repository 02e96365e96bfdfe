# SPDX-License-Identifier: Apache-2.0
"""Pictures of environments against lengths of the scene, and what films need."""

from __future__ import annotations

import gymnasium
import numpy as np
import pytest
from gymnasium.utils.env_checker import check_env

import tangere


def extent(pixels):
    """Width, height and number of the pixels that are marked, and the first row."""
    rows, columns = np.flatnonzero(pixels.any(1)), np.flatnonzero(pixels.any(0))
    return np.ptp(columns) + 1, np.ptp(rows) + 1, pixels.sum(), rows[0]


def orange(picture):
    return picture[..., 0] > picture[..., 2].astype(int) + 50


def blue(picture):
    return picture[..., 2] > picture[..., 0].astype(int) + 50


def test_lengths_are_those_of_the_scene():
    """A ball of 40 mm below a plate of 50 × 50 × 10 mm, from 30° to the side and 25° above."""
    env = tangere.make_env("ball_rolling_small", render_mode="rgb_array")
    env.reset(seed=1)
    picture = env.render()
    assert picture.shape == (384, 512, 3) and picture.dtype == np.uint8
    width, height, count, _ = extent(orange(picture))
    assert abs(width - height) <= 2  # without perspective a ball is a disc
    assert count == pytest.approx(np.pi / 4 * width * height, rel=0.03)
    scale = (width + height) / 2 / 0.04
    turn, lift = np.radians(30), np.radians(25)
    both = np.cos(turn) + np.sin(turn)
    across, down, _, top = extent(blue(picture))
    assert across == pytest.approx(scale * 0.05 * both, rel=0.02)
    assert down == pytest.approx(
        scale * (0.05 * both * np.sin(lift) + 0.01 * np.cos(lift)), rel=0.02
    )
    before = env.state()[0]
    for _ in range(8):
        env.step([0, 0, -0.5])
    after = env.state()[0]
    place = env.model.q_names.index("pad_joint.z")
    sunk = before[place] - after[place]
    assert sunk > 0.005
    later = env.render()
    assert extent(blue(later))[3] - top == pytest.approx(scale * sunk * np.cos(lift), abs=2)


def test_the_nearer_body_hides_the_other():
    env = tangere.make_env("insertion", render_mode="rgb_array")
    env.reset(seed=1)
    corners, body, _ = env.unwrapped._vector._env.faces(0)
    names = env.model.body_names
    assert len(corners) == len(body) and set(np.unique(body)) == set(range(-1, len(names)))
    picture = env.render().astype(int)
    assert ((picture[..., 0] - picture[..., 2]) > 60).sum() > 500  # the brown box in the gripper
    assert (picture.max(-1) < 60).sum() > 50  # black pads in front of it


@pytest.mark.parametrize("task", tangere.task_names())
def test_every_task_has_a_picture(task):
    if task == "ball_rolling":
        pytest.skip("ball_rolling_small is the same task with fewer points")
    env = gymnasium.make(tangere.gym_id(task), render_mode="rgb_array").unwrapped
    assert env.metadata["render_modes"] == ["rgb_array", "human"]
    step = env.task.steps_per_action * env.model.timestep
    assert env.metadata["render_fps"] == pytest.approx(1 / step)
    env.reset(seed=0)
    picture = env.render()
    assert len(np.unique(picture.reshape(-1, 3), axis=0)) > 8
    np.testing.assert_array_equal(env.render(), picture)


@pytest.mark.filterwarnings("ignore:.*Box observation space m:UserWarning")
@pytest.mark.filterwarnings("ignore:.*action space:UserWarning")
def test_gymnasium_checks_render(monkeypatch):
    monkeypatch.setenv("SDL_VIDEODRIVER", "dummy")
    check_env(gymnasium.make("tangere/StableGrasp-v0", render_mode="rgb_array").unwrapped)


def test_a_picture_hangs_on_neither_count_nor_threads():
    seen = []
    for envs, threads in ((1, 1), (3, 2)):
        env = tangere.make_vec("cap_opening", envs, threads=threads, render_mode="rgb_array")
        env.reset(seed=4)
        pictures = env.render()
        assert len(pictures) == envs
        env.step(env.scripted_action())
        seen.append((pictures[0], env.render()[0]))
    np.testing.assert_array_equal(seen[0], seen[1])
    assert (seen[0][0] != seen[0][1]).any()
    assert (pictures[0] != pictures[1]).any()  # other episodes have other caps


def test_an_episode_has_its_own_picture_after_a_reset():
    env = tangere.make_env("box_pushing", render_mode="rgb_array")
    env.reset(seed=3)
    first = env.render()
    env.step([1, 0, 0])
    env.reset()
    env.render()
    env.reset(seed=3)
    np.testing.assert_array_equal(env.render(), first)


def test_a_body_that_leaves_stays_in_the_picture():
    env = tangere.make_env("ball_rolling_small", render_mode="rgb_array")
    env.reset(seed=1)
    before = extent(orange(env.render()))[0]
    for _ in range(30):
        env.step([0, 0, 1])  # the pad flies up
    picture = env.render()
    rows = np.flatnonzero(blue(picture).any(1))
    assert len(rows) and rows[-1] < 383
    assert extent(orange(picture))[0] < before


def test_without_render_mode_there_is_no_picture():
    assert tangere.make_env("box_pushing").render() is None
    assert tangere.make_vec("box_pushing", 2).render() is None
    for make in (tangere.make_env, lambda *a, **k: tangere.make_vec(*a, 2, **k)):
        with pytest.raises(tangere.InputError, match="render_mode 'ansi'; expected None or one "):
            make("box_pushing", render_mode="ansi")
