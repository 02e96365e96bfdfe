# SPDX-License-Identifier: Apache-2.0
"""Scenes built in Python are those of files, to the bit, and mistakes name the line of Python."""

from __future__ import annotations

import inspect
import pickle
import subprocess
import warnings
from pathlib import Path

import numpy as np
import pytest

import tangere
from tangere import SceneBuilder, import_robot

ROOT = Path(__file__).parents[2]
ROBOTS = ROOT / "tests/data/robots"
SCENES = [*tangere.scenes().values(), *sorted((ROOT / "scenes/hard").glob("*.xml"))]
SCENES += [p for p in sorted((ROOT / "tests/data/scenes").glob("*.xml")) if p.stem != "tip"]


def run(scene: tangere.Scene) -> list[np.ndarray]:
    """What 20 steps with the scene's controls give."""
    model = tangere.Model(scene)
    sensors = [s.name for s in model.sensors]
    batch = tangere.Batch(model, num_envs=2, seed=3)
    run = batch.run(batch.scene_controls(20), every=5, fields=sensors)
    return [run.q, run.v, *(run.fields[name] for name in sensors)]


def here() -> int:
    """The line that calls."""
    return inspect.currentframe().f_back.f_lineno


def fault(build) -> str:
    """What is wrong with a scene to which `build` adds something."""
    b = gripper()
    with pytest.raises(tangere.InputError) as e:
        build(b)
        tangere.Model(b.scene())
    return str(e.value)


def gripper() -> SceneBuilder:
    """Two fingers with a skin on one, a rod between them, from nothing."""
    b = SceneBuilder("grip", gravity=(0, 0, -9.81), timestep=2e-3, integrator="BDF2")
    b.ground()
    b.default.surface_contact(kn=2e8, kt=2e5, mu=0.8, damping=2e8, ks=1e8)
    hand = b.robot.link("hand")
    hand.joint("hand", "prismatic", axis=(0, 0, 1), pos=(0, 0, 0.012), damping=2)
    hand.body("cuboid", size=(0.03, 0.1, 0.01), pos=(0, 0, 0.05), density=300)
    b.actuator.motor("hand", "position", P=800, D=20)
    for name, side in (("left", 1), ("right", -1)):
        finger = hand.link(name)
        finger.joint(name, "prismatic", axis=(0, -side, 0), pos=(0, 0.03 * side, 0), damping=1)
        finger.body("cuboid", size=(0.02, 0.01, 0.02), density=1000)
        b.actuator.motor(name, "force", ctrl_range=(-5, 5))
        b.contact.surface_contact(name, "rod")
    rod = b.robot.link("rod")
    rod.joint("rod", "free3d", pos=(0, 0, 0.012), quat=(1, 0, 1, 0))
    rod.body("cylinder", radius=0.012, length=0.12, density=800)
    b.contact.surface_contact("rod", "ground")
    corner = np.array([0.0095, -0.005, 0.0095])
    b.sensor.tactile(
        "left", "rect_array", rect_pos0=corner * [-1, 1, -1], rect_pos1=corner, axis0=(1, 0, 0),
        axis1=(0, 0, 1), resolution=(20, 20), per="area", kn=2e8, kt=2e5, mu=0.8, damping=2e8,
    )  # fmt: skip
    hold = b.control.piecewise(end=0.6)
    hold.at(time=0, value=(0, 0.8, 0.8))
    hold.at(time=0.2, value=(0.02, 0.8, 0.8))
    return b


def test_a_motor_maps_its_control_and_another_drives_the_same_joint() -> None:
    b = gripper()
    b.find("motor", joint="hand").set(scale=1e-3, offset=-0.01, u_range=(0, 255))
    b.actuator.motor("left", "force", name="boost", scale=2)
    for time in (0, 0.2):
        b.find("at", time=time).set(value=(0, 0.8, 0.8, 0))
    model = tangere.Model(b.scene())
    assert model.u_names == ["hand.rate", "left.rate", "right.rate", "boost"]
    ends = []
    for hand, left, boost in [(255, 0.8, 0), (1000, 0.4, 1)]:  # 0.4 of 5 N is 2 N more
        batch = tangere.Batch(model, num_envs=1)
        batch.run(np.tile([hand, left, 0.8, boost], (20, 1, 1)))
        ends.append(batch.q)
    np.testing.assert_allclose(ends[0], ends[1], atol=1e-12)


def test_a_joint_follows_by_a_polynomial() -> None:
    b = SceneBuilder()
    for name, kind in (("crank", "revolute"), ("slider", "prismatic")):
        link = b.robot.link(name)
        link.joint(name, kind, axis=(1, 0, 0), pos=(0, 0.2, 0), damping=0.01)
        link.body("cuboid", size=(0.05, 0.05, 0.05), density=800)
    b.find("joint", name="slider").set(follows="crank", ratio=0.1, offset=0.05, powers=(0.2, -0.05))
    b.actuator.motor("crank", "force", ctrl_range=(-0.01, 0.01))
    batch = tangere.Batch(tangere.Model(b.scene()), num_envs=2)
    batch.run(np.full((50, 2, 1), 0.5))
    crank, slider = batch.q.T
    assert abs(crank[0]) > 1e-3
    expected = 0.05 + 0.1 * crank + 0.2 * crank**2 - 0.05 * crank**3
    np.testing.assert_allclose(slider, expected, atol=1e-12)


@pytest.mark.parametrize("path", SCENES, ids=lambda p: p.stem)
def test_a_scene_that_is_read_and_written_is_the_same(path, tmp_path):
    with warnings.catch_warnings(record=True) as of_file:
        warnings.simplefilter("always")
        file = tangere.Scene(path)
    with warnings.catch_warnings(record=True) as of_text:
        warnings.simplefilter("always")
        builder = SceneBuilder.from_file(path)
        read = builder.scene()
    assert [str(w.message) for w in of_text] == [str(w.message) for w in of_file]
    assert SceneBuilder.from_string(builder.xml(), path).xml() == builder.xml()
    for of_file, of_text in zip(run(file), run(read), strict=True):
        np.testing.assert_array_equal(of_file, of_text)


def test_a_gripper_from_nothing_lifts_a_rod(tmp_path):
    assert len(inspect.getsource(gripper).splitlines()) <= 40
    b = gripper()
    model = tangere.Model(b.scene())
    assert (model.nq, model.nu, model.scene.name) == (10, 3, "grip")
    batch = tangere.Batch(model, num_envs=2)
    batch.run(batch.scene_controls(300))
    np.testing.assert_allclose(batch.bodies()[0][:, 3, 2], 0.032, atol=2e-3)
    np.testing.assert_allclose(batch.tactile("left.sum")[:, 1], 4, rtol=0.05)  # of 0.8 · 5 N
    b.write(tmp_path / "grip.xml")
    for of_file, of_text in zip(run(tangere.Scene(tmp_path / "grip.xml")), run(b.scene())):
        np.testing.assert_array_equal(of_file, of_text)
    again = pickle.loads(pickle.dumps(b.scene()))
    assert again.text == b.xml() == (tmp_path / "grip.xml").read_text()


def test_numbers_keep_their_bits():
    x = np.random.default_rng(1).normal(size=200) * 10.0 ** np.arange(-100, 100)
    b = SceneBuilder()
    for value in (x, x.tolist(), tuple(x), x.reshape(100, 2)):
        text = b.control.constant(value).attributes["value"]
        np.testing.assert_array_equal(np.array(text.split(), float), x)
    assert float(b.ground(size=np.float32(0.1)).attributes["size"]) == np.float32(0.1)
    tactile = b.sensor.tactile("a", "mesh", resolution=np.array([3, 4]), feels=["b", "c"])
    tactile.set(feedback=True, every=np.int64(2), scale=None)
    assert tactile.attributes == {
        "body": "a", "type": "mesh", "resolution": "3 4", "feels": "b,c", "feedback": "true",
        "every": "2",
    }  # fmt: skip
    tactile.set(every=None)
    assert "every" not in tactile.attributes
    assert b.robot.link('<"&>').attributes["name"] == '<"&>'
    assert 'name="&lt;' in b.xml() or "name='&lt;" in b.xml()


def test_a_mistake_names_the_line_that_made_it():
    def misspelt(b: SceneBuilder) -> None:
        b.robot.link("x").body("sphere", radus=1)

    line = here() - 2
    assert fault(misspelt) == (
        f"{__file__}:{line}: <body>: unknown attribute 'radus'; did you mean 'radius'?"
    )

    def unknown_body(b: SceneBuilder) -> None:
        b.contact.surface_contact("rod", "lift")
        b.robot.include("missing.xml")

    line = here() - 3
    b = gripper()
    unknown_body(b)
    with pytest.raises(OSError, match=f"{__file__}:{line + 1}: <include>: .*missing.xml"):
        b.scene()
    b.robot.inside.pop()
    with pytest.raises(tangere.InputError, match=f"{__file__}:{line}: <surface_contact>.*'left'"):
        b.scene()


def test_the_reader_checks_what_is_built():
    link = "no <link> in any <robot>"
    with pytest.raises(tangere.InputError, match=f"{__file__}:{here() + 1}: <tangere>: {link}"):
        SceneBuilder("empty").scene()
    said = fault(lambda b: b.find("body", radius=0.012).set(radius=-1))
    assert 'radius="-1"; expected a positive number' in said
    assert "expected finite numbers, found 'nan 1'" in fault(
        lambda b: b.find("motor", joint="left").set(ctrl_range=(np.nan, 1))
    )
    assert "2 ways to drive the scene" in fault(lambda b: b.control.constant(0))
    said = fault(lambda b: b.robot.find("link", name="left").find("body").set(mass=0))
    assert said.startswith(f"{__file__}:") and "joint 'left' moves nothing that has mass" in said
    assert "link name 'rod' is used twice" in fault(lambda b: b.robot.link("rod"))
    for value in (1j, {"a": 1}, [[1], [1, 2]], [True, False], ["a", 1], object()):
        assert "damping=" in fault(lambda b: b.default.joint(damping=value)), value
    assert "unknown attribute 'gravty'; did you mean 'gravity'?" in fault(
        lambda b: b.option(gravty=1)
    )
    with pytest.raises(AttributeError, match="boddy"):
        gripper().robot.link("a").boddy("sphere")
    with pytest.raises(TypeError, match="'type'"):
        gripper().robot.link("a").joint("b")


def test_elements_are_found_and_changed():
    b = gripper()
    b.find("joint", name="left").set(damping=4, pos=None)
    b.option(timestep=1e-3)  # stands once: the rest of it stays
    b.control.clear()
    b.control.constant((0, 0, 0))
    assert b.scene().timestep == 1e-3
    assert b.xml().count("<option") == 1 and 'integrator="BDF2"' in b.xml()
    assert '<joint name="left" type="prismatic" axis="0 -1 0" damping="4"/>' in b.xml()
    assert repr(b.find("motor", joint="right")).startswith('<motor joint="right" ctrl="force"')
    with pytest.raises(tangere.InputError, match="no <joint name=\"lft\"> .*did you mean 'left'"):
        b.robot.find("joint", name="lft")


def test_elements_are_found_by_the_names_that_they_have_without_one():
    b = gripper()
    b.randomize.tactile("left", "mu", uniform=(0.3, 0.9))
    b.initial.joint("left", q=0.001)
    assert "name" not in b.find("tactile", name="left").attributes
    assert b.find("body", name="rod") is b.robot.find("link", name="rod").find("body")
    assert b.find("joint", name="left") is b.robot.find("joint", name="left")
    assert b.randomize.find("tactile", name="left").attributes["field"] == "mu"
    with pytest.raises(tangere.InputError, match="no <body name=\"rd\"> .*did you mean 'rod'"):
        b.find("body", name="rd")
    with pytest.raises(tangere.InputError, match='no <motor name="left"> inside <tangere>$'):
        b.find("motor", name="left")


def test_numbers_of_vectors_vary_by_their_index():
    b = gripper()
    b.sensor.camera("eye", pos=(0, -0.3, 0.2), look=(0, 0, 0))
    b.randomize.camera("eye", pos=2, uniform=(0.15, 0.25))
    b.randomize.camera("eye", field="ambient", uniform=(0.2, 0.4))
    b.randomize.joint("left", q=0, uniform=(0, 0.001))
    b.randomize.body("hand", size=2, uniform=(0.05, 0.06))
    drawn = tangere.Batch(tangere.Model(b.scene()), num_envs=2, seed=3).randomized
    drawn = drawn() if callable(drawn) else drawn
    expected = ["camera eye pos[2]", "camera eye ambient", "joint left q[0]", "body hand size[2]"]
    assert [*drawn] == expected
    said = fault(lambda b: b.randomize.joint("left", uniform=(0, 1)))
    assert "expected exactly one of q, v, pos" in said


def test_one_of_several_elements_is_not_found_by_chance():
    b = gripper()
    size = "0.02 0.01 0.02"
    bodies = [e for e in b._all() if e.tag == "body" and e.attributes.get("size") == size]
    assert len(bodies) == 2
    with pytest.raises(tangere.InputError) as refused:
        b.find("body", size=(0.02, 0.01, 0.02))
    said = str(refused.value).splitlines()
    assert said[0].startswith('2 elements are <body size="0.02 0.01 0.02"> inside <tangere>; expec')
    assert said[1:] == [f"  {e.origin[0]}:{e.origin[1]}: {e}" for e in bodies]
    many = SceneBuilder("many")
    for k in range(11):
        many.robot.link(f"link{k}")
    with pytest.raises(tangere.InputError, match="(?s)11 elements are <link> .*link7.*and 3 more$"):
        many.find("link")
    assert many.find("link", name="link3").attributes["name"] == "link3"


def test_text_that_is_no_scene_is_refused():
    for text in ("", "<tangere>", "<tangere><a></tangere>", "<tangere/>\n<tangere/>", "no XML"):
        with pytest.raises(tangere.InputError, match="a.xml:[12]: not well-formed XML"):
            SceneBuilder.from_string(text, "a.xml")
    with pytest.raises(tangere.InputError, match="a.xml:2: <robot>: not a scene; .*import"):
        SceneBuilder.from_string("<!-- URDF -->\n<robot/>", "a.xml").scene()
    with pytest.raises(tangere.InputError, match="a.xml:2: <robo>: unknown element .*'robot'"):
        SceneBuilder.from_string("<tangere>\n<robo/></tangere>", "a.xml").scene()
    with pytest.raises(FileNotFoundError):
        SceneBuilder.from_file("missing.xml")


def test_comments_stay():
    text = "<!-- head\n  of it -->\n<tangere>\n  <!-- a & b -->\n  <ground/>\n</tangere>\n"
    assert SceneBuilder.from_string(text).xml() == text


def test_files_are_beside_the_folder(tmp_path):
    path = tangere.scenes()["mug"]
    b = SceneBuilder.from_file(path)
    with pytest.raises(OSError, match="mug"):
        b.write(tmp_path / "mug.xml")  # its mesh is not there
    assert not (tmp_path / "mug.xml").exists()
    moved = SceneBuilder.from_string(path.read_text(), tmp_path / "mug.xml")
    moved.folder = path.parent
    assert moved.scene().text == b.xml()
    own = SceneBuilder("own", folder=path.parent)
    body = own.robot.link("mug")
    body.joint("mug", "free3d")
    body.body("mesh", filename="meshes/mug.obj", transform_type="OBJ_TO_JOINT")
    assert tangere.Model(own.scene()).nb == 1
    gripper().write(tmp_path / "grip.xml")
    with pytest.raises(tangere.IoError, match="overwrite=True"):
        gripper().write(tmp_path / "grip.xml")
    gripper().write(tmp_path / "grip.xml", overwrite=True)


REQUESTS = {
    "hand.urdf": {
        "--pad": (["finger=gelsight_mini_measured@0,0,0.06", "tip=digit_guess@0,0,0,0.1,0.2,0.3"],
                  {"finger": ("gelsight_mini_measured", (0, 0, 0.06)),
                   "tip": ("digit_guess", np.array([0, 0, 0, 0.1, 0.2, 0.3]))}),
        "--motor": (["slide=force", "shoulder=30,2"], {"slide": "force", "shoulder": (30, 2)}),
        "--contact": (["finger=ground"], [("finger", "ground")]),
        "--end-effector": (["tip"], ["tip"]),
    },
    "gripper.urdf": {
        "--pad": ([f"left_finger={ROOT}/scenes/sensors/digit_guess.xml@-y"],
                  {"left_finger": (ROOT / "scenes/sensors/digit_guess.xml", "-y")}),
        "--motor": (["left_slide=2000"], {"left_slide": 2000}),
        "--base": (["free"], "free"),
        "--drop": ([], True),
    },
    "machine.xml": {"--keyframe": (["ready"], "ready"), "--drop": ([], True)},
    "meshes.xml": {"--drop": ([], True)},
    "kinds.xml": {"--drop": ([], True)},
    "including.xml": {"--drop": ([], True)},
    "arm.xml": {"--drop": ([], True)},
}  # fmt: skip
NAMES = {"--pad": "pads", "--motor": "motors", "--contact": "contacts",
         "--end-effector": "end_effectors"}  # fmt: skip


@pytest.mark.parametrize("name", REQUESTS)
def test_a_robot_is_that_of_the_command(name, command, tmp_path):
    words, options = [], {}
    for option, (texts, value) in REQUESTS[name].items():
        words += [w for text in texts for w in (option, text)] if texts else [option]
        options[NAMES.get(option, option.strip("-").replace("-", "_"))] = value
    output = tmp_path / (Path(name).stem + ".xml")
    command = [command, "import", ROBOTS / name, "-o", output, *words]
    said = subprocess.run(command, capture_output=True, text=True)
    assert said.returncode == 0, said.stderr
    with warnings.catch_warnings(record=True) as warned:
        warnings.simplefilter("always")
        robot = import_robot(ROBOTS / name, folder=tmp_path, **options)
        written = SceneBuilder.from_file(output)
        assert robot.xml() == written.xml()
        assert tangere.Model(robot.scene()).nb == tangere.Model(tangere.Scene(output)).nb
        for line in [str(w.message) for w in warned if w.filename == __file__]:
            assert line.rpartition("way: ")[2].rpartition("by it: ")[2] in said.stderr, line


def test_a_robot_is_extended():
    b = import_robot(ROBOTS / "gripper.urdf", pads={"left_finger": ("digit_guess", "-y")},
                     motors={"left_slide": (2000, 100)})  # fmt: skip
    ball = b.robot.link("ball", parent="palm")
    ball.joint("ball", "free3d", pos=(0, 0, 0.1))
    ball.body("sphere", radius=0.01, density=500)
    b.contact.surface_contact("ball", "left_finger", kn=1e8, damping=1e8)
    b.find("joint", name="left_slide").set(damping=3)
    with warnings.catch_warnings():
        warnings.filterwarnings("ignore", ".*times as stiff")
        model = tangere.Model(b.scene())
    assert "ball" in model.body_names and model.sensors[0].body == "left_finger"


def test_requests_for_a_robot_are_checked():
    def fault(**options) -> str:
        with pytest.raises(tangere.InputError) as e:
            import_robot(ROBOTS / "hand.urdf", **options)
        return str(e.value)

    assert "neither a file nor a layout of the program; did you mean 'digit_guess'" in fault(
        pads={"tip": "digit_gues"}
    )
    assert "did you mean 'tip'" in fault(pads={"tipp": "digit_guess"})
    assert "(1, 2); expected x y z or" in fault(pads={"tip": ("digit_guess", (1, 2))})
    assert "'forc'; expected 'force', P or P, D" in fault(motors={"slide": "forc"})
    assert "a gain P above 0" in fault(motors={"slide": -1})
    assert "did you mean 'slide'" in fault(motors={"slid": "force"})
    assert "expected 'fixed' or 'free'" in fault(base="loose")
    with pytest.raises(tangere.InputError, match="muscle(.|\n)*drop=True"):
        import_robot(ROBOTS / "arm.xml")
    with pytest.raises(OSError):
        import_robot(ROBOTS / "missing.urdf")
