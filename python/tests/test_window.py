# SPDX-License-Identifier: Apache-2.0
"""render_mode="human": the window has the pictures of rgb_array, and errors name what is missing.

SDL draws into memory here. A pygame that is not there fails these tests: requirements.txt has it.
"""

from __future__ import annotations

import os
import subprocess
import sys

import gymnasium
import numpy as np
import pytest

import tangere


class Press(tangere.VectorSceneEnv):
    scene, steps_per_action, horizon = tangere.scenes()["rolling_ball_small"], 20, 3

    def reward(self, actions):
        return np.zeros(self.num_envs)


@pytest.fixture
def pygame(monkeypatch):
    monkeypatch.setenv("SDL_VIDEODRIVER", "dummy")
    monkeypatch.setenv("PYGAME_HIDE_SUPPORT_PROMPT", "1")
    import pygame

    yield pygame
    pygame.display.quit()


def shown(pygame):
    """(height, width, 3) of the window."""
    return pygame.surfarray.array3d(pygame.display.get_surface()).transpose(1, 0, 2)


MAKERS = [
    lambda mode: gymnasium.make("tangere/BoxPushing-v0", render_mode=mode),
    lambda mode: tangere.SceneEnv(Press, render_mode=mode),
]


@pytest.mark.parametrize("make", MAKERS)
def test_every_reset_and_step_shows_the_picture(pygame, make):
    env, drawn = make("human"), make("rgb_array")
    assert env.unwrapped.render_mode == "human"
    assert not pygame.display.get_init()  # it opens with the first picture
    pictures = []
    for k in range(3):
        for e in (env, drawn):
            e.reset(seed=3) if k == 0 else e.step(np.array([0.5, 0, -0.5], np.float32))
        pictures.append(drawn.render())
        np.testing.assert_array_equal(shown(pygame), pictures[-1])
    assert (pictures[0] != pictures[2]).any()
    assert env.render() is None
    np.testing.assert_array_equal(shown(pygame), pictures[-1])
    env.close()
    assert not pygame.display.get_init()
    drawn.close()


@pytest.mark.parametrize("make", [
    lambda n, mode: tangere.make_vec("stable_grasp", n, seed=1, render_mode=mode),
    lambda n, mode: Press(n, seed=1, render_mode=mode),
])  # fmt: skip
def test_a_window_has_many_environments(pygame, make):
    env, drawn = make(3, "human"), make(3, "rgb_array")
    for e in (env, drawn):
        e.reset()
    assert shown(pygame).shape == (768, 1024, 3)
    for k, picture in enumerate(drawn.render()):
        y, x = divmod(k, 2)
        np.testing.assert_array_equal(shown(pygame)[384 * y :, 512 * x :][:384, :512], picture)
    assert (shown(pygame)[384:, 512:] == 0).all()
    many = make(40, "human")
    many.reset()
    assert shown(pygame).shape == (768, 1024, 3)  # 16 of them, of 256 × 192
    small = drawn.render()[2].reshape(192, 2, 256, 2, 3).mean((1, 3))
    assert np.abs(shown(pygame)[:192, 512:768] - small).max() < 2
    env.step(np.zeros(env.single_action_space.shape))  # another size again
    assert shown(pygame).shape == (768, 1024, 3)
    env.close(), many.close()
    assert not pygame.display.get_init()


def test_the_window_goes_at_the_rate_of_the_simulation(pygame):
    env = Press(1, render_mode="human")
    rates = []
    clock = type("Clock", (), {"tick": lambda _, rate: rates.append(rate)})
    env._rendering._window._clock = clock()
    env.reset()
    env.step(np.zeros(3))
    env.render()
    assert rates == [pytest.approx(1 / (20 * env.model.timestep))] * 3
    env.close()


def test_gymnasiums_own_wrapper_still_shows_pictures(pygame):
    env = gymnasium.wrappers.HumanRendering(
        gymnasium.make("tangere/BoxPushing-v0", render_mode="rgb_array")
    )
    env.reset(seed=3)
    np.testing.assert_array_equal(shown(pygame), env.env.render())
    env.close()


ASK = "import tangere; env = tangere.make_env('box_pushing', render_mode='human'); env.reset()"


@pytest.mark.parametrize(
    ("before", "said"),
    [
        ("import sys; sys.modules['pygame'] = None; ",
         "IoError: render_mode 'human' without the package pygame; expected it from `pip install"),
        ("", "IoError: render_mode 'human': SDL found no display; expected one in DISPLAY or"),
        ("import os; os.environ['SDL_VIDEODRIVER'] = 'x11'; ",
         "IoError: render_mode 'human': x11 not available; expected one in DISPLAY or WAYLAND"),
    ],
)  # fmt: skip
def test_without_package_or_display_there_is_an_error(before, said):
    kept = {k: v for k, v in os.environ.items()
            if k not in ("DISPLAY", "WAYLAND_DISPLAY", "SDL_VIDEODRIVER")}  # fmt: skip
    done = subprocess.run([sys.executable, "-c", before + ASK], env=kept, capture_output=True,
                          text=True, stdin=subprocess.DEVNULL)  # fmt: skip
    assert done.returncode == 1 and said in done.stderr, done.stderr
    assert done.stdout == ""  # pygame's greeting is not in it
