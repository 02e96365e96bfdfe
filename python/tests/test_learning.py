# SPDX-License-Identifier: Apache-2.0
"""The programs of learning/: their mathematics against plain loops, and that each one learns."""

from __future__ import annotations

import contextlib
import copy
import dataclasses
import importlib
import io
import json
import runpy
import shutil
import subprocess
import sys
import unittest.mock
from pathlib import Path
from xml.etree import ElementTree

import numpy as np
import pytest
from ball_rolling import BallRolling

torch = pytest.importorskip("torch", reason="PyTorch is not installed")

LEARNING = Path(__file__).parents[2] / "learning"
sys.path.insert(0, str(LEARNING))

import bc  # noqa: E402
import dagger  # noqa: E402
import experiments  # noqa: E402
import gd  # noqa: E402
import matching  # noqa: E402
import ppo  # noqa: E402
import protocol  # noqa: E402
import report  # noqa: E402

import tangere  # noqa: E402
import tangere.data  # noqa: E402
import tangere.torch  # noqa: E402


def run(program: str, *arguments: str) -> dict:
    """What a program prints with --json. It runs here: PyTorch is imported once."""
    path, printed = LEARNING / program, io.StringIO()
    words, threads = [str(path), *arguments, "--json"], torch.get_num_threads()
    with unittest.mock.patch.object(sys, "argv", words), contextlib.redirect_stdout(printed):
        with torch.random.fork_rng(devices=[]):
            runpy.run_path(str(path), run_name="__main__")
    torch.set_num_threads(threads)
    return json.loads(printed.getvalue())


@pytest.mark.parametrize("memory", [["--no-recurrent"], ["--recurrent", "--last_gamma", "0.995"]])
def test_ppo_learns_to_hold_a_ball(memory):
    found = run("ppo.py", "dummy", "--steps", "8192", "--envs", "16", "--length", "64",
                "--deviation", "0.3", "--rate", "3e-3", "--choices", "2", "--episodes", "50",
                "--threads", "1", *memory)  # fmt: skip
    first = np.mean([row[1] for row in found["curve"][:2]])
    assert found["test"]["return"] > first + 20, (first, found["test"])
    assert found["test"]["return"] > -15


OWN_TASK = """
import numpy as np
import tangere


class Hold(tangere.VectorSceneEnv):
    \"\"\"Keeps a ball at its start: the pad pushes where it was told to.\"\"\"

    scene, steps_per_action, horizon, actions = tangere.scenes()["rolling_ball_small"], 5, 4, 1

    def controls(self, actions):
        return np.pad(actions * 0.1, ((0, 0), (2, 0)))

    def restart(self, envs):
        if not hasattr(self, "wanted"):
            self.wanted = np.zeros((self.num_envs, 1))
        self.wanted[envs] = self.uniform(envs, [-0.8], 0.8)

    def observe(self):
        return {"wanted": self.wanted, "pad": self.batch.tactile("pad")}

    def reward(self, actions):
        return -abs(actions - self.wanted)[:, 0]

    def success(self):
        return self.lengths == self.horizon
"""


def test_ppo_learns_a_task_of_a_file(tmp_path):
    (tmp_path / "own_task.py").write_text(OWN_TASK)
    words = ["ppo.py", f"{tmp_path}/own_task.py:Hold", "--steps", "10240", "--envs", "32",
             "--length", "16", "--deviation", "0.3", "--rate", "3e-3", "--choices", "2",
             "--episodes", "50", "--threads", "1", "--gamma", "0.5"]  # fmt: skip
    found = run(*words, "--without", "pad")
    assert found["test"]["return"] > -0.8 > found["curve"][0][1], found  # 4 actions: -1.6 at first
    assert found["test"]["success"] == 1 and found["test"]["episodes"] == 50
    for wrong, message in ((["--without", "wanted", "--without", "pad"], "--without pad; the"),
                           (["--imitate", "0.5"], "Hold has no scripted_action()")):  # fmt: skip
        done = subprocess.run([sys.executable, str(LEARNING / "ppo.py"), *words[1:], *wrong],
                              capture_output=True, text=True)  # fmt: skip
        assert done.returncode == 1 and message in done.stderr, done.stderr
    with pytest.raises(SystemExit, match="'nothing'; expected one of ball_rolling.*FILE.py:CLASS"):
        protocol.make_vec("nothing", 1)
    file = f"{tmp_path}/own_task.py"
    with pytest.raises(SystemExit, match=r"own_task.py has \['Hold'\] .*, not 'Held'"):
        protocol.make_vec(f"{file}:Held", 1)
    with pytest.raises(SystemExit, match="there is no file .*own_tusk.py"):
        protocol.make_vec(f"{tmp_path}/own_tusk.py:Hold", 1)


def test_every_skin_is_one_of_every_task_with_pads():
    from skins import SKINS, skin_scene

    for task in ("stable_grasp", "insertion"):
        found = {}
        for skin in SKINS:
            batch = tangere.Batch(tangere.Model(skin_scene(task, skin)), 4, seed=1, threads=1)
            run = batch.run(batch.scene_controls(150), every=10, fields=["left_pad.ideal"])
            force = np.abs(run.fields["left_pad.ideal"]).sum((2, 3)).max(0)  # (E, 3)
            found[skin] = np.stack([force[:, :2].sum(1), force[:, 2]])
        assert found["springs"].min() > 0.01
        for skin in SKINS:  # all of them have the force of the grip
            assert np.all(np.abs(np.log(found[skin] / found["springs"])) < np.log(2)), (task, skin)


def test_images_have_one_size():
    shapes = {"small": (4, 4, 3), "left": (20, 20, 3), "right": (20, 20, 3), "flow": (2, 13, 10),
              "points": (30, 3), "force": (6,)}  # fmt: skip
    eyes = ppo.Eyes(shapes, convolve=True)
    assert eyes.images == ["left", "right"] and eyes.flat == ["small", "flow", "points", "force"]
    assert eyes.shapes == ((6, 10, 10), (48 + 260 + 90 + 6,))
    assert ppo.Eyes(shapes, convolve=False).images == []


def test_ppo_imitates_the_script():
    found = run("ppo.py", "dummy", "--steps", "8192", "--envs", "16", "--length", "64", "--rate",
                "3e-3", "--choices", "1", "--episodes", "50", "--threads", "1", "--imitate", "1",
                "--passes", "10")  # fmt: skip
    assert found["test"]["return"] > found["curve"][0][1] + 20, found
    assert found["test"]["success"] > 0.8, found["test"]


def test_a_model_learns_the_derivatives_that_it_is_shown(generate):
    data = generate("box_pushing", "--episodes", "12", "--seed", "1", "--gradients", "jacobians")
    words = (str(data), "--sizes", "8", "--updates", "50")
    plain, shown = (run("matching.py", *words, "--match", m)["curve"] for m in ("0", "0.1"))
    assert plain[0][0] == 8 and 0 < plain[0][1] < 1 and 0 < shown[0][1] < 1
    assert plain != shown


def test_the_model_differentiates_itself():
    model = matching.Model(4, 3, 8).double()
    z, r = torch.randn(5, 4).double(), torch.randn(5, 4).double()
    found = model(z, r)[1]
    step = 1e-6
    difference = (model(z + step * r, r)[0] - model(z - step * r, r)[0]) / (2 * step)
    assert (found - difference).abs().max() < 1e-8


def test_gd_learns_to_push():
    found = run("gd.py", "box_pushing_privileged", "--updates", "20", "--goals", "50",
                "--threads", "1")  # fmt: skip
    assert found["test"]["return"] > found["curve"][0] + 100, found
    assert found["steps"] == 20 * 16 * 100 and len(found["choice"]) == 2


def test_gd_goes_back_from_a_spoiled_policy():
    found = run("gd.py", "box_pushing_privileged", "--updates", "60", "--envs", "4", "--rate",
                "0.02", "--back", "1", "--goals", "20", "--threads", "1")  # fmt: skip
    least, expected = np.inf, []
    for update, _, place, yaw in found["choice"]:
        errors = place / protocol.PLACE_UNIT + yaw / protocol.YAW_UNIT
        if not errors < least:
            expected.append(update)
        least = min(least, errors)
    assert found["went_back"] == expected and expected


def test_clones_learn_from_a_data_set(generate):
    data = generate("insertion_translation", "--episodes", "300", "--seed", "1")
    found = run("bc.py", str(data), "--epochs", "20", "--episodes", "200")
    assert found["test"]["success"] > 0.5, found  # random actions: 0.35
    assert found["data"]["command"].startswith("tangere generate insertion_translation")


def test_a_data_set_of_a_class_is_refused_by_name(tmp_path, monkeypatch):
    tangere.data.generate(BallRolling, tmp_path / "own", 1, policy="random")
    monkeypatch.setattr(sys, "argv", ["bc.py", str(tmp_path / "own")])
    with pytest.raises(SystemExit, match="is of BallRolling; expected a data set of one of"):
        bc.main()


@pytest.mark.parametrize("choice", [[], ["--choice"]])
def test_a_clone_may_see_the_state(generate, monkeypatch, choice):
    data = generate("box_pushing", "--episodes", "4", "--seed", "1")
    monkeypatch.setattr(sys, "argv", ["bc.py", str(data), "--state", "--episodes", "3", *choice])
    asked = bc.settings()
    windows = bc.Windows(str(data), ["goal", "q"], split=None)
    shown = []

    def clone(seen):
        shown.append(seen)
        return torch.zeros(3, 3)

    bc.closed_loop(windows, clone, asked)
    env = tangere.make_vec("box_pushing", 3)
    seed = protocol.CHOICE_SEED if choice else protocol.TEST_SEED
    obs, _ = env.reset(seed=seed)
    start = np.concatenate([obs["goal"], env.state()[0] / bc.STATE_UNIT], axis=1)
    np.testing.assert_allclose(shown[0], start, rtol=1e-5, atol=1e-6)
    row = windows[0]["obs"]
    assert row["q"].shape == (1, len(env.model.q_names)) and shown[0].shape == (3, 3 + 7)


def test_a_clone_with_memory_learns_from_its_visits(generate):
    data = generate("insertion_translation", "--episodes", "100", "--seed", "1")
    words = (str(data), "--updates", "30", "--episodes", "200", "--threads", "1", "--alone", "1")
    found = run("dagger.py", *words, "--rounds", "8", "--visits", "32")
    assert found["test"]["success"] > 0.5, found  # random actions: 0.35
    assert [row[2] is None for row in found["curve"]] == [True] + [False] * 7
    assert found["rows"] < 300  # the episodes of the data set alone


def test_visits_are_what_the_clone_saw_and_the_script_would_have_done():
    task = tangere.task_spec("insertion_rotation")
    env = tangere.make_vec("insertion_rotation", 8, autoreset="disabled", threads=1)
    torch.manual_seed(0)
    clone = dagger.Recurrent(int(np.prod(task.observations[0].shape)), task.action)
    rows = dagger.Rows(10, task.horizon, int(np.prod(task.observations[0].shape)), 1)
    played = dagger.visit(env, clone, ["flow"], 16, rows)
    assert rows.count == 8 and not rows.there[8:].any()
    np.testing.assert_array_equal(rows.there[:8].sum(1), played.actions)
    one = tangere.make_env("insertion_rotation", seed=dagger.VISIT_SEED, first_episode=16 + 3)
    obs, _ = one.reset()
    for t in range(played.actions[3]):
        seen = dagger.flat({"flow": obs["flow"][None]}, ["flow"])[0]
        np.testing.assert_allclose(rows.seen[3, t], seen, atol=1e-6)
        np.testing.assert_allclose(rows.wanted[3, t], one.scripted_action(), atol=1e-6)
        action = clone(rows.seen[3:4, : t + 1])[0][0, -1].detach().numpy()  # from the first row on
        obs, *_ = one.step(action)


@pytest.mark.parametrize("method", ["bc", "td3", "iql"])
def test_offline_methods_learn_from_mixed_data(generate, method):
    data = generate("box_pushing", "--episodes", "40", "--seed", "1", "--noise", "0.3",
                    "--mix", "random=0.5")  # fmt: skip
    found = run("offline.py", str(data), "--method", method, "--updates", "20", "--episodes",
                "50", "--threads", "1")  # fmt: skip
    assert found["test"]["score"] > 50, found  # after one update: 38 to 45
    assert found["rows"] == 36 * 100  # those of mask/train


def test_the_gradient_of_two_passes_is_that_of_one():
    tape = tangere.torch.Tape("box_pushing", 4, 12, threads=1, flatten=True)
    gains = gd.touch_gains(tape.spec, 0.05)
    torch.manual_seed(0)
    policy = gd.small_policy(len(gains), 3)
    gd.update(tape, policy, gains, 0, 3, 0)
    found = [p.grad.clone() for p in policy.parameters()]
    for p in policy.parameters():
        p.grad = None
    obs, total = tape.reset(seed=3), 0
    for _ in range(12):
        obs, reward, _ = tape.step(gd.act(policy, obs, gains))
        total = total + reward
    (-total.mean()).backward()
    for got, p in zip(found, policy.parameters()):
        size = p.grad.abs().max()
        assert size > 0 and (got - p.grad).abs().max() < 1e-4 * size


def test_an_episode_counts_at_most_so_many_medians():
    by_action = torch.ones(5, 4, 2)
    by_action[:, 1] *= 1e6
    by_action[2, 2, 0] = float("nan")
    kept = gd.limited(by_action, 3.0)
    norms = kept.square().sum(dim=(0, 2)).sqrt()
    assert float(norms[1]) == pytest.approx(3 * float(norms[0]), rel=1e-5)
    assert torch.equal(kept[:, 0], by_action[:, 0]) and not kept[:, 2].any()
    assert torch.equal(gd.limited(by_action[:, :2], 0), by_action[:, :2])


def collected(task: str, *options: str):
    """A collector of a task and its first batch."""
    argv, sys.argv = sys.argv, ["ppo.py", task, "--envs", "8", "--length", "12", *options]
    try:
        asked = ppo.settings()
    finally:
        sys.argv = argv
    asked.threads = 1
    torch.manual_seed(0)
    spec = tangere.task_spec(task)
    eyes = ppo.Eyes({t.name: t.shape for t in spec.observations}, asked.convolve)
    agent = ppo.Agent(eyes.shapes, spec.action.shape[0], asked.deviation, asked.recurrent)
    collector = ppo.Collector(asked, agent, eyes)
    return asked, agent, collector, collector.collect()


@pytest.mark.parametrize("task", ["insertion_rotation", "box_pushing", "cap_opening"])
def test_before_an_update_all_chances_are_as_they_were_drawn(task):
    """Sequences with memory, resets and images say what single steps said."""
    _, agent, _, (batch, first, ended) = collected(task)
    assert (task == "insertion_rotation") == bool(batch["end"].any()) and bool(ended) == bool(
        batch["end"].any()
    )
    with torch.no_grad():
        mean, value = agent.sequence(batch["image"], batch["rest"], first, batch["past"],
                                     batch["begins"])  # fmt: skip
    chance = ppo.log_likelihood(batch["action"], mean, agent.log_deviation)
    assert (chance - batch["chance"]).abs().max() < 1e-4
    assert (value - batch["value"]).abs().max() < 1e-4


def test_advantages_are_sums_of_discounted_surprises():
    asked, _, collector, (batch, _, _) = collected("insertion_rotation")
    last = torch.randn(8)
    found = collector._advantages(batch, last)
    value = torch.cat([batch["value"], last[None]])
    for e in range(8):
        for t in range(asked.length):
            total, weight = 0.0, 1.0
            for k in range(t, asked.length):
                on = 0.0 if batch["end"][k, e] else 1.0
                delta = batch["reward"][k, e] + asked.gamma * on * value[k + 1, e] - value[k, e]
                total, weight = total + weight * float(delta), weight * asked.gamma * asked.trace
                if not on:
                    break
            assert float(found[t, e]) == pytest.approx(total, abs=1e-4)


def test_running_moments_are_those_of_all_rows():
    rows = np.random.default_rng(1).normal(3, 2, (500, 4))
    running = ppo.Running((4,))
    for part in np.split(rows, 5):
        running.add(part)
    np.testing.assert_allclose(running.mean, rows.mean(0), rtol=1e-5)
    np.testing.assert_allclose(running.square / running.count, rows.var(0), rtol=1e-4)
    image = np.random.default_rng(2).normal(0, 5, (20, 3, 4, 4))
    running = ppo.Running((3, 4, 4))
    running.add(image)
    np.testing.assert_allclose(running.mean.ravel(), image.mean((0, 2, 3)), rtol=1e-4)


def test_images_of_fields_sum_the_forces_of_four_pixels():
    spec = tangere.task_spec("cap_opening")
    field = np.random.default_rng(0).normal(size=(2, 3, 20, 20, 3)).astype(np.float32)
    zeros = {t.name: np.zeros((2, *t.shape), np.float32) for t in spec.observations}
    shapes = {t.name: t.shape for t in spec.observations}
    image, rest = ppo.Eyes(shapes, convolve=True)._arrays(zeros | {"tactile": field})
    assert image.shape == (2, 9, 10, 10) and rest.shape == (2, 18)
    np.testing.assert_allclose(
        image[1, 3 + 2, 4, 7], field[1, 1, 8:10, 14:16, 2].sum(), rtol=1e-5
    )  # finger 1, normal force


def test_play_counts_what_stepping_one_environment_counts():
    env = tangere.make_vec("insertion_rotation", 6, autoreset="disabled", threads=1)
    played = protocol.play(env, 5, lambda env, _obs, t: np.full((6, 1), 0.3 * (-1) ** t))
    for e in range(6):
        one = tangere.gym.TaskEnv("insertion_rotation", first_episode=e, seed=5)
        one.reset()
        total = 0.0
        for t in range(one.task.horizon):
            _, reward, terminated, truncated, info = one.step(np.full(1, 0.3 * (-1) ** t))
            total += reward
            if terminated or truncated:
                break
        assert (played.returns[e], played.actions[e], played.solved[e]) == (
            total, t + 1, info["success"])  # fmt: skip


def test_box_errors_are_distances_between_poses():
    env = tangere.make_vec("box_pushing", 3, autoreset="disabled", threads=1)
    played = protocol.play(env, 5, lambda env, _obs, _t: env.scripted_action())
    _, _, memory = env.state()
    np.testing.assert_array_equal(
        played.solved, (played.position < 0.03) & (played.yaw < 0.1)
    )  # the task's own criterion, in the world
    assert np.all(memory[:, 0] > 0.19) and np.all(played.position < 0.1)


def test_the_best_policy_solves_most():
    poor, good = {"success": 0.4, "return": -30.0}, {"success": 0.9, "return": -130.0}
    assert protocol.merit(good) > protocol.merit(poor) > (-np.inf,)
    assert protocol.merit(good | {"return": -100.0}) > protocol.merit(good)
    near, far = ({"position_m": place, "yaw_rad": 0.1} for place in (0.1, 0.2))
    assert protocol.merit(near) > protocol.merit(far) > (-np.inf,)
    assert not protocol.merit(near | {"yaw_rad": float("nan")}) > (-np.inf,)


def test_intervals_are_those_of_tables():
    low, high = protocol.wilson(0.9, 100)
    assert low == pytest.approx(0.8256, abs=1e-4) and high == pytest.approx(0.9448, abs=1e-4)
    assert protocol.wilson(1.0, 1000)[1] == pytest.approx(1.0)
    # Student, five values: t = 2.776, s = √2.5.
    assert protocol.student([1, 2, 3, 4, 5]) == pytest.approx(2.776 * np.sqrt(2.5 / 5), rel=1e-6)
    with pytest.raises(ValueError, match="1 runs; expected 2 to 10"):
        protocol.student([1.0])


def test_every_experiment_is_a_command_that_its_program_takes(monkeypatch):
    names = [e.name for e in experiments.EXPERIMENTS]
    assert len(set(names)) == len(names)
    for experiment in experiments.EXPERIMENTS:
        words = experiments.command_of(experiment, 3, "cpu")
        monkeypatch.setattr(sys, "argv", words)
        asked = importlib.import_module(Path(words[0]).stem).settings()
        assert asked.seed == 3 and asked.json
        assert experiment.data.split()[0] in experiment.command if experiment.data else True


def test_a_result_of_another_command_or_data_set_is_stale(monkeypatch, tmp_path):
    monkeypatch.setattr(experiments, "RESULTS", tmp_path)
    each = experiments.Experiment("bc-x", "bc.py out/learning/x", 1, 1, "a row", data="x task")
    assert experiments.stored(each, 0) is None
    experiments.result_of(each, 0).write_text(json.dumps({"experiment": experiments.made_by(each)}))
    assert experiments.stored(each, 0) and report.stored(each)
    for other in ({"command": "bc.py out/learning/x --all"}, {"data": "x task --seed 2"}):
        assert not report.stored(dataclasses.replace(each, **other))
    experiments.result_of(each, 0).write_text("{}")  # one that does not say
    assert experiments.stored(each, 0) is None


def test_results_do_not_make_a_tree_dirty(monkeypatch, tmp_path):
    if shutil.which("git") is None:
        pytest.skip("git is not installed")
    monkeypatch.setattr(experiments, "ROOT", tmp_path)
    assert experiments.commit() == ""
    (tmp_path / "learning/results").mkdir(parents=True)
    files = [tmp_path / "learning/results/a.json", tmp_path / "learning/gd.py"]
    user = ("-c", "user.name=a", "-c", "user.email=a@b.c")
    for file in files:
        file.write_text("1")
    for words in (["init", "-q"], ["add", "."], [*user, "commit", "-qm", "first"]):
        subprocess.run(["git", *words], cwd=tmp_path, check=True)
    clean = experiments.commit()
    assert 7 <= len(clean) <= 12
    files[0].write_text("2")
    assert experiments.commit() == clean
    files[1].write_text("2")
    assert experiments.commit() == clean + "-dirty"


def test_the_page_says_what_the_results_say():
    page = report.PAGE.read_text()
    between = page.split(report.BEGIN)[1].split(report.END)[0]
    assert between == report.tables()  # python learning/report.py --write


def test_the_report_has_means_and_intervals(monkeypatch, tmp_path):
    monkeypatch.setattr(experiments, "RESULTS", tmp_path)
    each = experiments.Experiment("gd-x", "gd.py", 3, 1, "a row", "0.1 m")
    test = {"episodes": 100, "position_m": 0.05, "yaw_rad": 0.1, "success": 0.8}
    result = {"steps": 480000, "train_cpu_s": 60, "test": test,
              "experiment": experiments.made_by(each)}  # fmt: skip
    for seed, place in enumerate((0.04, 0.05, 0.06)):
        one = copy.deepcopy(result)
        one["test"]["position_m"] = place
        experiments.result_of(each, seed).write_text(json.dumps(one))
    runs = report.stored(each)
    assert report.mean(report.tested(runs, "position_m"), " m") == "0.050 ± 0.025 m"
    assert report.rate(runs) == "80.0 ± 7.8 %"  # Wilson's of 100: the runs share their episodes
    for run, (success, actions) in zip(runs, ((0.5, 3.0), (0.0, 0.0), (0.2, 5.0))):
        run["test"] |= {"success": success, "actions_solved": actions}
    assert report.until(runs[:2]) == "3.00" and report.until(runs[1:2]) == "–"
    assert report.until(runs).startswith("4.00 ± ")
    monkeypatch.setattr(report, "EXPERIMENTS", [each])
    lines = report.table("| what | place | runs | paper |", ("gd-",), lambda r: ["x"]).splitlines()
    assert lines == ["| what | place | runs | paper |", "|---|---|---|---|",
                     "| a row | x | 3 | 0.1 m |"]  # fmt: skip
    others = dataclasses.replace(each, first_seed=2)
    assert list(experiments.seeds(others)) == [2, 3, 4] and len(report.stored(others)) == 1
    assert report.earlier().endswith(": `gd-x`.\n")  # without "test_seed"
    run = {"settings": {"task": "cap_opening"}, "choice": [[1, 0.0, 0.0]] * 5}
    assert report.choosing([run]) == "0.30"  # million: 5 × 300 episodes × 200 actions
    for seed, commit in enumerate(("a-dirty", "b", "c-dirty")):
        made = result | {"commit": commit, "test_seed": protocol.TEST_SEED}
        experiments.result_of(each, seed).write_text(json.dumps(made))
    assert report.earlier() == ""
    assert report.unclean().replace("\n", " ").endswith("other results alone: `gd-x` (2). ")


def test_the_figure_has_a_line_for_each_run(monkeypatch, tmp_path):
    monkeypatch.setattr(experiments, "RESULTS", tmp_path)
    assert report.figure() == ""
    for name, program in (("gd-touch", "gd"), ("ppo-box", "ppo")):
        each = next(e for e in experiments.EXPERIMENTS if e.name == name)
        for seed in experiments.seeds(each)[:2]:
            result = {"program": program, "steps": 3200, "settings": {"updates": 2},
                      "choice": [[1, -500.0], [2, -400.0]],
                      "experiment": experiments.made_by(each)}  # fmt: skip
            experiments.result_of(each, seed).write_text(json.dumps(result))
    root = ElementTree.fromstring(report.figure())
    lines = root.findall("{http://www.w3.org/2000/svg}polyline")
    assert len(lines) == 4
    # Two updates of 1600 actions end at the right; -500 of -800 to 0 is 90 of 240 high.
    assert lines[0].get("points").split()[0] == "320.0,180.0"
    assert lines[0].get("points").split()[1].startswith("580.0,")


def test_curves_are_logged_for_tensorboard(generate, tmp_path, monkeypatch):
    import tracking

    monkeypatch.setitem(sys.modules, "torch.utils.tensorboard", None)
    with pytest.raises(SystemExit, match="--log here needs the package tensorboard"):
        tracking.Log("here")
    tracking.Log(None)(1, loss=2.0)
    monkeypatch.undo()
    pytest.importorskip("tensorboard", reason="tensorboard is not installed")
    from tensorboard.backend.event_processing.event_accumulator import EventAccumulator

    data = generate("stable_grasp", "--episodes", "20", "--seed", "1")
    run("bc.py", str(data), "--epochs", "3", "--episodes", "16", "--log", str(tmp_path / "log"))
    written = EventAccumulator(str(tmp_path / "log")).Reload()
    losses = written.Scalars("loss")
    assert [point.step for point in losses] == [1, 2, 3]
    assert losses[0].value > losses[2].value > 0


def test_a_clone_learns_from_pictures(tmp_path):
    pytest.importorskip("h5py", reason="h5py is not installed")
    found = run("pictures.py", str(tmp_path / "set"), "--demos", "8", "--episodes", "8",
                "--epochs", "2", "--threads", "1", "--see", "eye", "left.rgb_marker")  # fmt: skip
    assert found["keys"] == ["eye", "left.rgb_marker"] and found["rows"] > 0
    assert 0 <= found["test"]["success"] <= 1 and found["script"]["success"] > 0.5


def test_a_clone_of_insertion_learns_from_pictures_with_history(tmp_path):
    pytest.importorskip("h5py", reason="h5py is not installed")
    found = run("pictures.py", str(tmp_path / "set"), "--task", "insertion", "--demos", "16",
                "--episodes", "8", "--epochs", "1", "--threads", "1", "--see", "flow",
                "left.rgb_marker_grip")  # fmt: skip
    assert found["rows"] > 16 and found["script"]["success"] > 0.5
    assert 0 <= found["test"]["success"] <= 1


def test_a_box_beside_the_hole_is_not_inserted():
    import picture_tasks

    env = picture_tasks.playing("insertion", ["flow"])(2, threads=1, autoreset="disabled")
    env.reset(seed=3)
    for _ in range(8):  # 10 mm each along x, over a wall
        info = env.step(np.tile([0.5, 0, 0], (2, 1)))[-1]
    assert (env.batch.q[:, 6] > 0.05).all() and (env.batch.q[:, 8] < -0.01).all()
    assert not info["success"].any()
