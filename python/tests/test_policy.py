# SPDX-License-Identifier: Apache-2.0
"""A function of Python plays the episodes of a data set, here and as a program of its own."""

from __future__ import annotations

import io
import json
import subprocess
import sys

import h5py
import numpy as np
import pytest

import tangere
from tangere import policy as policies
from tangere.data import Episodes, generate

SCRIPT = """
import sys
import numpy as np
import tangere.policy

def choose(obs, episodes, actions):
    print("a word to nobody")
    answer = 0.3 * obs["goal"] + 0.01 * actions[:, None] - 0.001 * episodes[:, None]
    return answer

tangere.policy.serve(choose, name="follow-2")
"""


def follow(obs, episodes, actions):
    return 0.3 * obs["goal"] + 0.01 * actions[:, None] - 0.001 * episodes[:, None]


def test_a_tensor_with_gradients_is_an_action(tmp_path):
    torch = pytest.importorskip("torch")
    weight = torch.full((3,), 0.25, requires_grad=True)

    def choose(obs, episodes, actions):
        return weight * torch.ones(len(episodes), 3)

    assert generate("box_pushing", tmp_path / "set", 2, policy=choose, name="weights")["rows"] > 0
    np.testing.assert_array_equal(Episodes(tmp_path / "set")[0]["actions"], np.float32(0.25))
    env = tangere.make_vec("box_pushing", 2)
    env.reset(seed=1)
    other = tangere.make_vec("box_pushing", 2)
    other.reset(seed=1)
    np.testing.assert_array_equal(
        env.step(choose({}, np.arange(2), None))[1], other.step(np.full((2, 3), 0.25))[1]
    )


@pytest.fixture(scope="module")
def followed(tmp_path_factory):
    folder = tmp_path_factory.mktemp("policy") / "followed"
    said = generate("box_pushing", folder, 20, policy=follow, name="follow-2", seed=4, threads=1)
    return said, folder


def test_the_file_has_what_the_function_does_in_an_environment(followed):
    said, folder = followed
    assert (said["policy"], said["episodes"], said["task"]) == ("program", 20, "box_pushing")
    episodes = Episodes(folder)
    assert list(episodes.attributes["policies"]) == ["follow-2"]
    assert episodes.attributes["dataset_id"] == "tangere/box_pushing/follow-2-v0"
    env = tangere.make_vec("box_pushing", 20, seed=4, autoreset="disabled")
    obs, _ = env.reset()
    plain = tangere.make_vec("box_pushing", 20, seed=4, autoreset="disabled", normalise=False)
    seen, _ = plain.reset()
    for t in range(100):
        action = follow(obs, np.arange(20), np.full(20, t))
        for e in (0, 7, 19):
            stored = episodes[e]
            np.testing.assert_allclose(stored["actions"][t], np.clip(action[e], -1, 1), atol=1e-6)
            np.testing.assert_allclose(stored["goal"][t], seen["goal"][e], atol=1e-6)
        obs, seen = env.step(action)[0], plain.step(action)[0]
    assert len(episodes[0]["actions"]) == 100


def test_threads_and_processes_change_no_bit(followed, tmp_path, command):
    _, folder = followed
    generate("box_pushing", tmp_path / "two", 20, policy=follow, name="follow-2", seed=4, threads=2)
    assert (tmp_path / "two/shard-00000.h5").read_bytes() == (
        folder / "shard-00000.h5"
    ).read_bytes()
    (tmp_path / "policy.py").write_text(SCRIPT)
    program = f"{sys.executable} {tmp_path / 'policy.py'}"
    words = ["box_pushing", "--episodes", "20", "--seed", "4", "--threads", "2", "--output"]
    subprocess.run(
        [command, "generate", *words, tmp_path / "own", "--program", program],
        check=True, stdin=subprocess.DEVNULL, capture_output=True,
    )  # fmt: skip
    with h5py.File(tmp_path / "own/shard-00000.h5") as own:
        with h5py.File(folder / "shard-00000.h5") as here:
            assert own.attrs["content_sum"] == here.attrs["content_sum"]
            assert program in own.attrs["command"] and "TANGERE_PYTHON" in here.attrs["command"]


def test_noise_and_random_episodes_go_with_a_function(tmp_path):
    asked = []

    def count(obs, episodes, actions):
        asked.extend(episodes.tolist())
        return np.zeros((len(episodes), 3))

    mixed = ("--mix", "random=0.5", "--noise", "0.1")
    generate("box_pushing", tmp_path / "a", 16, policy=count, name="still", options=mixed)
    with h5py.File(tmp_path / "a/robomimic.hdf5") as file:
        still = {int(n.decode()[5:]) for n in file["mask/still"]}
        assert len(still) + len(file["mask/random"]) == 16 and 0 < len(still) < 16
        assert set(asked) == still and len(asked) == 100 * len(still)
        actions = np.concatenate([file[f"data/demo_{e}/actions"][()] for e in still])
    assert np.abs(actions.std() - 0.1) < 0.01


def raised(error):
    raise error


@pytest.mark.parametrize(
    "answer, error, message",
    [
        (lambda n: np.zeros((n, 2)), tangere.InputError, r"shape \(16, 2\); expected \(16, 3\)"),
        (lambda n: np.zeros(3 * n), tangere.InputError, "actions of shape"),
        (lambda n: np.full((n, 3), np.nan), tangere.InputError, "nan as number 0 of action"),
        (lambda n: 1 / 0, ZeroDivisionError, "division"),
        (lambda n: raised(BrokenPipeError("its own")), BrokenPipeError, "its own"),
    ],
)
def test_a_wrong_answer_leaves_nothing(tmp_path, answer, error, message):
    def late(obs, episodes, actions):
        return answer(len(episodes)) if actions[0] > 5 else np.zeros((len(episodes), 3))

    with pytest.raises(error, match=message):
        generate("box_pushing", tmp_path / "out", 16, policy=late, name="wrong")
    assert not list(tmp_path.iterdir())


def test_mistakes_are_told(tmp_path):
    zero = lambda obs, episodes, actions: np.zeros((len(episodes), 3))  # noqa: E731
    for given, message in [
        ({"policy": zero}, "without a name"),
        ({"policy": zero, "name": "two words"}, "calls itself 'two words'"),
        ({"policy": zero, "name": "train"}, "no name of a mask"),
        ({"policy": "randon"}, "unknown policy 'randon'"),
        ({"policy": zero, "name": "x", "options": ["--policy", "hold"]}, "expected program"),
    ]:
        with pytest.raises(tangere.InputError, match=message):
            generate("box_pushing", tmp_path / "out", 16, **given)
    assert not list(tmp_path.iterdir())
    said = generate("box_pushing_reduced", tmp_path / "plain", 3, policy="hold")
    assert said["policy"] == "hold" and len(Episodes(tmp_path / "plain")) == 3
    left = subprocess.run([sys.executable, "-m", "tangere.policy"], capture_output=True, text=True)
    assert left.returncode == 2 and "run that program again" in left.stderr


def test_the_conversation():
    hello = {
        "protocol": policies.PROTOCOL, "task": "t", "seed": 1, "horizon": 3,
        "observations": [{"name": "a", "shape": [2]}, {"name": "b", "shape": [1, 3]}],
        "action": {"shape": [2], "low": -1, "high": 1},
    }  # fmt: skip
    rows = np.arange(10, dtype="<f4").reshape(2, 5)
    question = np.array([2, 7, 9, 0, 4], "<i8").tobytes() + rows.tobytes()
    asked, begun = [], []

    def choose(obs, episodes, actions):
        asked.append((obs["a"].tolist(), obs["b"].shape, episodes.tolist(), actions.tolist()))
        return [[1, 2], [3, 4]]

    output = io.BytesIO()
    text = json.dumps(hello).encode() + b"\n"
    count = policies.converse(
        io.BytesIO(text + question), output, choose, "me", normalise=False, begin=begun.append
    )
    assert count == 1 and begun[0]["horizon"] == 3
    assert asked == [([[0, 1], [5, 6]], (2, 1, 3), [7, 9], [0, 4])]
    line, answer = output.getvalue().split(b"\n", 1)
    assert json.loads(line) == {"protocol": policies.PROTOCOL, "name": "me", "normalise": False}
    assert np.frombuffer(answer[:8], "<i8")[0] == 4
    np.testing.assert_array_equal(np.frombuffer(answer[8:], "<f8"), [1, 2, 3, 4])
    with pytest.raises(EOFError):
        policies.converse(io.BytesIO(text + question[:-1]), io.BytesIO(), choose, "me")
    with pytest.raises(tangere.InputError, match="expected one with the protocol"):
        policies.converse(io.BytesIO(b'{"x": 1}\n'), io.BytesIO(), choose, "me")
