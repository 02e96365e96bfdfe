# SPDX-License-Identifier: Apache-2.0
"""robomimic makes, trains and plays what the files of `tangere generate` name."""

from __future__ import annotations

import json

import h5py
import numpy as np
import pytest

import tangere

pytest.importorskip("torch", reason="PyTorch is not installed")
pytest.importorskip("robomimic", reason="robomimic is not installed")
rm = pytest.importorskip("tangere.robomimic")


@pytest.fixture(scope="module")
def env_meta(pushes):
    import robomimic.utils.file_utils as file_utils

    return file_utils.get_env_metadata_from_dataset(str(pushes / "robomimic.hdf5"))


def test_a_file_names_its_environment(env_meta, pushes):
    import robomimic.utils.env_utils as env_utils

    env = env_utils.create_env_from_metadata(env_meta)
    assert isinstance(env, rm.EnvTangere) and env_utils.get_env_type(env=env) == env_meta["type"]
    assert env_utils.get_env_class(env_meta=env_meta) is rm.EnvTangere
    assert env.serialize() == env_meta and env.version == tangere.__version__
    with h5py.File(pushes / "robomimic.hdf5") as file:
        shapes = {key: rows.shape[1:] for key, rows in file["data/demo_0/obs"].items()}
    assert {key: value.shape for key, value in env.reset().items()} == shapes
    assert env.action_dimension == 3 and env.is_success() == {"task": False}
    again = env_utils.create_env_for_data_processing(env_meta, [], None, None, None)
    assert isinstance(again, rm.EnvTangere)


def test_an_episode_is_that_of_the_file(pushes, env_meta):
    env = rm.EnvTangere(env_meta["env_name"], seed=5, **env_meta["env_kwargs"])
    seen, total = env.reset(), 0.0
    with h5py.File(pushes / "robomimic.hdf5") as file:
        demo = file["data/demo_0"]
        for t, action in enumerate(demo["actions"]):
            for key, value in seen.items():
                close = {"rtol": 1e-5, "atol": 1e-6}
                np.testing.assert_allclose(value, demo["obs"][key][t], err_msg=key, **close)
            assert not env.is_done()
            seen, reward, done, _ = env.step(action)
            assert reward == env.get_reward()
            total += reward
        assert done and env.is_done()
        assert env.is_success()["task"] == bool(demo.attrs["success"])
        assert total == pytest.approx(demo.attrs["return"], rel=1e-5)
    assert env.reset()["goal"].tolist() != seen["goal"].tolist()


def test_a_state_can_be_come_back_to(env_meta):
    env = rm.EnvTangere(env_meta["env_name"], seed=3)
    env.reset(), env.reset()
    for _ in range(7):
        env.step(env.env.scripted_action())
    state, seen = env.get_state(), env.get_observation()
    env.reset()
    back = rm.EnvTangere(env_meta["env_name"]).reset_to(state)
    for key, value in seen.items():
        np.testing.assert_array_equal(back[key], value)
    with pytest.raises(tangere.InputError, match="without a seed"):
        rm.EnvTangere(env_meta["env_name"]).get_state()


def test_other_names_go_to_robomimics_own_class():
    import robomimic.utils.env_utils as env_utils

    with pytest.raises(Exception) as caught:  # the old gym is not there, or has no such name
        env_utils.create_env(env_type=2, env_name="Hopper-v99")
    assert not isinstance(caught.value, tangere.InputError)
    for arguments, message in [
        ({"env_name": "tangere/None-v0"}, "tangere/None-v0"),
        ({"env_name": "tangere/BoxPushing-v0", "task": "stable_grasp"}, "stable_grasp"),
        ({"env_name": "tangere/BoxPushing-v0", "render_offscreen": True}, "render_video"),
    ]:
        with pytest.raises(tangere.InputError, match=message):
            env_utils.create_env(env_type=2, **arguments)


EYE = '<camera name="eye" pos="0 -0.25 0.2" look="0 0 0.02" rows="32" cols="32"/>'


def test_a_policy_learns_from_pictures(generate, tmp_path):
    """By names without dots: robomimic keeps networks in a ModuleDict, which takes no dots."""
    train = pytest.importorskip("robomimic.scripts.train")
    import torch
    from robomimic.config import config_factory

    text = tangere.scenes()["rolling_ball_small"].read_text()
    scene = tmp_path / "watched.xml"
    scene.write_text(text.replace("</sensor>", EYE + "</sensor>"))
    data = generate(str(scene), "--episodes", "4", "--steps", "60", "--every", "10", "--record",
                    "q,pad.sum,eye.rgb,eye.depth")  # fmt: skip
    config = config_factory("bc")
    with config.unlocked():
        config.train.data = str(data / "robomimic.hdf5")
        config.train.output_dir = str(tmp_path / "out")
        config.train.num_epochs, config.train.batch_size = 1, 4
        config.train.cuda, config.train.hdf5_cache_mode = False, None
        config.train.hdf5_load_next_obs = True
        config.train.num_data_workers = 0
        config.experiment.name, config.experiment.epoch_every_n_steps = "clone", 2
        config.experiment.validate = config.experiment.render_video = False
        config.experiment.rollout.enabled = config.experiment.save.enabled = False
        config.experiment.logging.log_tb = False
        config.experiment.logging.terminal_output_to_txt = False
        config.observation.modalities.obs.low_dim = ["pad_sum"]
        config.observation.modalities.obs.rgb = ["eye_rgb"]
        config.observation.modalities.obs.depth = ["eye_depth"]
        for kind in ("rgb", "depth"):
            core = config.observation.encoder[kind].core_kwargs
            core.backbone_class = "ResNet18Conv"
            core.backbone_kwargs = {"pretrained": False, "input_coord_conv": False}
    threads = torch.get_num_threads()
    try:
        train.train(config, torch.device("cpu"))
    finally:
        torch.set_num_threads(threads)


def test_a_policy_is_trained_and_played(pushes, tmp_path, capsys):
    train = pytest.importorskip("robomimic.scripts.train")
    import torch
    from robomimic.config import config_factory

    config = config_factory("bc")
    with config.unlocked():
        config.train.data = str(pushes / "robomimic.hdf5")
        config.train.output_dir = str(tmp_path)
        config.train.hdf5_filter_key = "train_success"
        config.train.num_epochs = 2
        config.train.batch_size = 64
        config.train.cuda = False
        config.experiment.name = "clone"
        config.experiment.epoch_every_n_steps = 20
        config.experiment.validate = False
        config.experiment.render_video = False
        config.experiment.logging.log_tb = False
        config.experiment.logging.terminal_output_to_txt = False
        config.experiment.save.every_n_epochs = 1
        config.experiment.rollout.rate = 2
        config.experiment.rollout.n = 2
        config.experiment.rollout.horizon = 100
        config.observation.modalities.obs.low_dim = ["goal", "tactile"]
    threads = torch.get_num_threads()
    try:
        train.train(config, torch.device("cpu"))
    finally:
        torch.set_num_threads(threads)
    model = sorted(tmp_path.rglob("*.pth"))[-1]
    capsys.readouterr()
    assert rm.main([str(model), "--episodes", "2", "--json"]) == 0
    found = json.loads(capsys.readouterr().out.splitlines()[-1])
    assert found["task"] == "box_pushing" and found["episodes"] == 2
    assert found["mean_actions"] == 100 and -1e4 < found["mean_return"] < 0
    assert rm.main([str(model), "--episodes", "0"]) == 2
    assert rm.main([str(tmp_path / "absent.pth")]) == 3
    (tmp_path / "damaged.pth").write_bytes(model.read_bytes()[:1000])
    assert rm.main([str(tmp_path / "damaged.pth")]) == 2
