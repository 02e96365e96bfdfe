# SPDX-License-Identifier: Apache-2.0
"""Cameras of a scene in Python: arrays of a batch and a run, observations of environments of one's
own, pictures of render(), data sets and their export."""

import io
import subprocess

import gymnasium
import numpy as np
import pytest

import tangere
from tangere.data import Episodes, Windows

h5py = pytest.importorskip("h5py")

EYE = '<camera name="eye" pos="0 -0.25 0.2" look="0 0 0.02" rows="24" cols="32"/>'


@pytest.fixture(scope="module")
def watched(tmp_path_factory):
    """The file of the small rolling ball with a camera."""
    text = tangere.scenes()["rolling_ball_small"].read_text()
    assert "</sensor>" in text
    path = tmp_path_factory.mktemp("scene") / "watched.xml"
    path.write_text(text.replace("</sensor>", EYE + "</sensor>"))
    return path


def test_arrays_have_the_shape_and_type_of_pictures(watched):
    model = tangere.Model(tangere.Scene(watched))
    (eye,) = model.cameras
    assert (eye.name, eye.body, eye.rows, eye.cols) == ("eye", "", 24, 32)
    assert {"eye.rgb", "eye.depth", "eye.ids"} <= set(model.readings)
    batch = tangere.Batch(model, 3, seed=1)
    rgb, depth, ids = (batch.tactile(f"eye.{form}") for form in ("rgb", "depth", "ids"))
    assert (rgb.shape, rgb.dtype) == ((3, 24, 32, 3), np.uint8)
    assert (depth.shape, depth.dtype) == ((3, 24, 32, 1), np.float32)
    assert (ids.shape, ids.dtype) == ((3, 24, 32, 1), np.int16)
    ball = model.body_names.index("ball")
    assert set(np.unique(ids)) <= {-1, *range(model.nb + 1)} and (ids == ball).sum() > 20
    # The middle of the ball is about as deep as it is far from the camera.
    middle = batch.bodies()[0][0, ball, :3]
    forward = np.array([0, 0.25, -0.18]) / np.hypot(0.25, 0.18)
    at = (middle - [0, -0.25, 0.2]) @ forward
    assert depth[0][ids[0] == ball].min() == pytest.approx(at - 0.02, abs=2e-3)
    run = batch.run(np.zeros((20, 3, model.nu)), every=20, fields=["eye.rgb", "eye.ids"])
    np.testing.assert_array_equal(run.fields["eye.rgb"][0], batch.tactile("eye.rgb"))
    assert run.fields["eye.ids"].dtype == np.int16
    out = np.empty_like(rgb)
    assert batch.tactile("eye.rgb", out=out) is out
    with pytest.raises(tangere.InputError, match="no reading is named 'eye.rgbd'"):
        batch.tactile("eye.rgbd")
    with pytest.raises(tangere.InputError, match="array of int16"):
        batch.tactile("eye.ids", out=np.empty(ids.shape))


class Watch(tangere.VectorSceneEnv):
    """Sees the ball."""

    steps_per_action, horizon = 5, 10

    def observe(self):
        return {"v": self.batch.v, "eye": self.batch.tactile("eye.rgb"),
                "depth": self.batch.tactile("eye.depth")}  # fmt: skip

    def reward(self, actions):
        return np.zeros(self.num_envs)


def test_environments_keep_bytes_and_render_them(watched):
    env = Watch(2, scene=watched, seed=1, render_mode="rgb_array")
    space = env.single_observation_space["eye"]
    assert (space.dtype, space.shape, space.high.max()) == (np.uint8, (24, 32, 3), 255)
    assert env.single_observation_space["depth"].dtype == np.float32
    seen, _ = env.reset(seed=1)
    assert seen["eye"].dtype == np.uint8 and seen in env.observation_space
    seen, *_ = env.step(np.zeros((2, env.model.nu)))
    assert seen in env.observation_space
    pictures = env.render()
    assert len(pictures) == 2
    np.testing.assert_array_equal(np.stack(pictures), seen["eye"])
    flat = Watch(2, scene=watched, seed=1, flatten=True)
    assert flat.reset(seed=1)[0].dtype == np.float32
    from gymnasium.utils.env_checker import check_env

    check_env(tangere.SceneEnv(Watch, scene=watched, render_mode="rgb_array"))


def test_data_sets_of_a_class_keep_bytes(watched, tmp_path):
    from tangere.data import generate

    class Seen(Watch):
        scene = watched

        def observe(self):
            return super().observe() | {"ids": self.batch.tactile("eye.ids")}

    folder = tmp_path / "set"
    generate(Seen, folder, 3, policy="random", seed=2)
    files = tmp_path / "files"
    generate(Seen, files, 3, policy="random", seed=2, options=["--pictures", "jpeg:90"])
    like, raw = Episodes(files)[2]["eye"], Episodes(folder)[2]["eye"]
    assert like.shape == raw.shape and np.abs(like.astype(float) - raw).mean() < 6
    with pytest.raises(tangere.InputError, match="pictures 'jpg'; expected raw, or jpeg:QUALITY"):
        generate(Seen, tmp_path / "no", 1, policy="random", options=["--pictures", "jpg"])
    with h5py.File(next(folder.glob("shard-*.h5"))) as shard:
        demo = shard["data/demo_1"]
        types = {key: demo[f"obs/{key}"].dtype for key in ("eye", "depth", "ids")}
        assert types == {"eye": np.uint8, "depth": np.float32, "ids": np.int16}
        pictures, last = demo["obs/eye"][:], demo["final_obs/eye"][0]
        actions = demo["actions"][:]
    env = Seen(1, seed=2, first_episode=1)
    seen, _ = env.reset()
    for picture, action in zip(pictures, actions, strict=True):
        np.testing.assert_array_equal(picture, seen["eye"][0])
        seen, *_ = env.step(action[None])
    np.testing.assert_array_equal(last, seen["eye"][0])


def test_data_sets_of_a_class_have_the_gains_of_pictures(watched, tmp_path):
    from tangere.data import generate

    gained = tmp_path / "gained.xml"
    gained.write_text(watched.read_text().replace('name="eye"', 'name="eye" gain="0.1"'))

    class Seen(Watch):
        scene = gained

    generate(Seen, tmp_path / "set", 3, policy="random", seed=2)
    episodes = Episodes(tmp_path / "set")
    plain = Watch(1, scene=watched, seed=2, first_episode=2)
    seen, _ = plain.reset()
    gains = episodes.picture_gains(2)
    assert list(gains) == ["eye"] and gains["eye"].shape == (3,)
    wanted = np.minimum(gains["eye"] * seen["eye"][0], 255)
    assert np.abs(episodes[2]["eye"][0] - wanted).max() < 1.1
    assert (gains["eye"] != episodes.picture_gains(1)["eye"]).all()


def test_a_task_renders_what_its_camera_sees(watched, tmp_path):
    env = tangere.make_env("ball_rolling_small", scene=watched, render_mode="rgb_array")
    env.reset(seed=3)
    first = env.render()
    assert first.shape == (24, 32, 3) and first.std() > 0
    for _ in range(5):
        env.step(env.action_space.sample() * 0 + 1)
    assert (env.render() != first).any()
    assert isinstance(env, gymnasium.Env)


@pytest.fixture(scope="module")
def seen(generate, watched):
    return generate(str(watched), "--episodes", "2", "--seed", "4", "--steps", "60", "--every",
                    "20", "--record", "q,v,pad,eye.rgb,eye.depth,eye.ids")  # fmt: skip


@pytest.fixture(scope="module")
def stored(generate, watched):
    """The same with JPEG files."""
    return generate(str(watched), "--episodes", "2", "--seed", "4", "--steps", "60", "--every",
                    "20", "--record", "q,v,pad,eye.rgb,eye.depth,eye.ids/40",
                    "--pictures", "jpeg:95")  # fmt: skip


def test_jpeg_files_are_pictures_for_readers(seen, stored, tmp_path):
    raw, episodes = Episodes(seen), Episodes(stored)
    assert str(episodes.attributes["pictures"]) == "jpeg:95"
    for of, like in ((episodes[1], raw[1]), (episodes.final(1), raw.final(1))):
        assert of["eye.rgb"].shape == like["eye.rgb"].shape and of["eye.rgb"].dtype == np.uint8
        far = of["eye.rgb"].astype(float) - like["eye.rgb"]
        assert 0 < np.sqrt((far**2).mean()) < 6
        np.testing.assert_array_equal(of["eye.depth"], like["eye.depth"])
    rows, ids = episodes.samples(1)["eye.ids"]
    assert (list(rows), ids.dtype) == ([0, 2], np.int16)
    windows = Windows(stored, ["eye.rgb", "pad"], before=1, split=None)
    batch = windows.gather(np.array([0, 4]))["obs"]
    assert batch["eye.rgb"].dtype == np.uint8 and batch["pad"].dtype == np.float32
    np.testing.assert_array_equal(batch["eye.rgb"][1], episodes[1]["eye.rgb"][:2])
    few = Windows(stored, ["eye.rgb"], before=1, split=None, memory=0)
    np.testing.assert_array_equal(few.gather(np.array([0, 4]))["obs"]["eye.rgb"], batch["eye.rgb"])
    scaled = Windows(stored, ["eye.rgb"], scale="standard", split=None, form="image")[0]["obs"]
    assert scaled["eye.rgb"].dtype == np.float32 and scaled["eye.rgb"].shape == (1, 3, 24, 32)


def test_merged_files_have_names_without_dots(seen, stored):
    for data in (seen, stored):
        with h5py.File(data / "robomimic.hdf5") as merged:
            demo = merged["data/demo_1"]
            for name in ("eye.rgb", "eye.depth"):
                plain = name.replace(".", "_")
                np.testing.assert_array_equal(demo["obs"][plain][()], demo["obs"][name][()])
                if name in demo["next_obs"]:
                    np.testing.assert_array_equal(demo["next_obs"][plain][:-1],
                                                  demo["obs"][name][1:])  # fmt: skip
        one = Episodes(data / "robomimic.hdf5")
        assert "eye_rgb" not in one[1] and one[1]["eye.rgb"].dtype == np.uint8


def test_another_reader_opens_jpeg_files(stored):
    image = pytest.importorskip("pygame.image")
    surfarray = pytest.importorskip("pygame.surfarray")
    with h5py.File(next(stored.glob("shard*.h5"))) as shard:
        files = shard["data/demo_1/obs/eye.rgb"]
        assert files.dtype.kind == "S" and files.shape == (3,)
        surfaces = [image.load(io.BytesIO(file)) for file in files]
    pictures = [surfarray.array3d(s).transpose(1, 0, 2).astype(int) for s in surfaces]
    assert np.abs(np.stack(pictures) - Episodes(stored)[1]["eye.rgb"]).max() <= 3


def test_damaged_jpeg_files_are_refused(stored):
    (file,) = Episodes(stored)._demo(0)["obs/eye.rgb"][:1].tolist()
    with pytest.raises(tangere.InputError, match="here: picture 1: .* as JPEG"):
        tangere._core.decode_jpeg([file, b"no picture"], "here")
    assert tangere._core.decode_jpeg([file]).shape == (1, 24, 32, 3)


def test_data_sets_name_the_camera_and_its_bodies(seen):
    with h5py.File(next(seen.glob("*.h5"))) as shard:
        eye = shard["scene/cameras/eye"]
        assert list(eye.attrs["names"]) == ["pad", "ball", "ground"]
        assert eye.attrs["focal_pixels"] == pytest.approx(12 / np.tan(np.radians(22.5)))
        obs = shard["data/demo_1/obs"]
        kinds = [obs[f"eye.{form}"].dtype for form in ("rgb", "depth", "ids")]
        assert kinds == [np.uint8, np.float32, np.int16]
    episodes = Episodes(seen)
    assert episodes.picture_gains(0) == {}
    assert "eye" in episodes.cameras and episodes[1]["eye.ids"].shape == (3, 24, 32, 1)


@pytest.mark.parametrize("touch", [None, "state"])
@pytest.mark.parametrize("data", ["seen", "stored"])
def test_lerobot_gets_colours_as_images(request, data, tmp_path, touch):
    pytest.importorskip("pyarrow")
    from tangere import lerobot

    done = lerobot.export(request.getfixturevalue(data), tmp_path / "out", touch=touch)
    assert "observation.images.eye.rgb" in done.features
    assert "observation.eye.depth" in done.features
    assert ("observation.eye.ids" in done.features) == (data == "seen")


def test_a_mistake_names_file_and_line(command, watched, tmp_path):
    bad = tmp_path / "bad.xml"
    bad.write_text(watched.read_text().replace('rows="24"', 'rows="24" up="0 0.45 -0.324"'))
    done = subprocess.run([command, "inspect", bad], capture_output=True, text=True)
    assert done.returncode == 2
    assert "bad.xml:" in done.stderr and "lies along the view" in done.stderr


def test_simulations_refuse_them(watched):
    torch = pytest.importorskip("torch")
    assert torch is not None
    import tangere.torch as tt

    with pytest.raises(tangere.InputError, match="eye.rgb"):
        tt.Simulation(tangere.Scene(watched), 1, 10, read=["eye.rgb"])


def test_a_builder_adds_them_and_mistakes_name_its_line():
    b = tangere.SceneBuilder("ball", gravity=(0, 0, 0))
    b.ground()
    ball = b.robot.link("ball")
    ball.joint("ball", "free3d", pos=(0, 0, 0.1))
    ball.body("sphere", radius=0.05, density=100, rgba=(1, 0, 0, 1))
    b.sensor.camera("above", pos=(0, 0, 1), look=(0, 0, 0), up=(0, 1, 0), rows=9, cols=9)
    batch = tangere.Batch(tangere.Model(b.scene()), 1)
    assert batch.tactile("above.ids")[0, 4, 4, 0] == 0
    assert batch.tactile("above.depth")[0, 4, 4, 0] == pytest.approx(0.85, abs=1e-4)
    b.sensor.camera("below", pos=(0, 0, -1), look=(0, 0, 0))
    with pytest.raises(tangere.InputError, match=r"test_cameras.py:\d+: .*lies along the view"):
        b.scene()
