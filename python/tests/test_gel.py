# SPDX-License-Identifier: Apache-2.0
"""Calibrations of other makers: device files of GelSight, height maps and tables of Taxim, made
here from known numbers, read back and fitted."""

import json
import struct
import subprocess
import sys
import zlib

import numpy as np
import pytest

import tangere
from tangere import gel

ROWS, COLS, LAMPS = 12, 16, 6


def grey_png(levels, filters):
    """A grey PNG of 16 bits whose lines have these filters in turn."""
    rows, cols = levels.shape
    raw = np.ascontiguousarray(levels.astype(">u2")).view(np.uint8).reshape(rows, 2 * cols)
    above, packed = np.zeros(2 * cols, int), b""
    for k, line in enumerate(raw.astype(int)):
        left = np.concatenate([[0, 0], line[:-2]])
        corner = np.concatenate([[0, 0], above[:-2]])
        guess = left + above - corner
        far = [abs(guess - near) for near in (left, above, corner)]
        paeth = np.where((far[0] <= far[1]) & (far[0] <= far[2]), left,
                         np.where(far[1] <= far[2], above, corner))  # fmt: skip
        kind = filters[k % len(filters)]
        taken = (0 * line, left, above, (left + above) // 2, paeth)[kind]
        packed += bytes([kind]) + ((line - taken) & 255).astype(np.uint8).tobytes()
        above = line

    def chunk(name, data):
        check = struct.pack(">I", zlib.crc32(name + data))
        return struct.pack(">I", len(data)) + name + data + check

    head = struct.pack(">IIBBBBB", cols, rows, 16, 0, 0, 0, 0)
    return (b"\x89PNG\r\n\x1a\n" + chunk(b"IHDR", head) + chunk(b"IDAT", zlib.compress(packed))
            + chunk(b"IEND", b""))  # fmt: skip


@pytest.fixture
def device(tmp_path):
    """A device file, its numbers (lamp, place, term) and its flat field, 0 to 1."""
    random = np.random.default_rng(5)
    lamps = 0.1 * random.normal(size=(LAMPS, 6, 10))
    lamps[:, -1, 9] += [0.1, 0.5, 0.5, 0.5, 0.5, 0.5]
    levels = random.integers(20000, 40000, (2 * ROWS, 3 * COLS))
    (tmp_path / "flat.png").write_bytes(grey_png(levels, (0, 1, 2, 3, 4)))
    values = ", ".join(repr(float(x)) for x in lamps.transpose(1, 0, 2).ravel())
    (tmp_path / "device.yaml").write_text(
        f"createdon: 2026-01-01 00:00:00\nnL: {LAMPS}\nwidth: {4 * COLS}\nheight: {4 * ROWS}\n"
        f"mmperpixel: 0.006\nquadfit: \n    rows: 6\n    cols: {10 * LAMPS}\n"
        f"    values: [{values}]\nflatfield: \n    modelfile: flat.png\n"
        f"    modelsize: ({COLS}, {ROWS})\n    nL: {LAMPS}\n"
        f"    scale: [{', '.join(['0.4'] * LAMPS)}]\n    size: ({4 * COLS}, {4 * ROWS})\n"
        "targetscans: \n  - a: b\n"
    )
    flat = (levels / 65535).reshape(2, ROWS, 3, COLS).swapaxes(1, 2).reshape(-1, ROWS, COLS)
    return tmp_path / "device.yaml", lamps, flat


def level(lamp, flat, row, col, normal):
    """What a lamp gives at a pixel, term by term."""
    smaller = min(ROWS, COLS)
    x, y = (col - (COLS + 1) / 2) / smaller, (row - (ROWS + 1) / 2) / smaller
    q = np.array([x * x, x * y, y * y, x, y, 1]) @ lamp
    matrix = np.array([[q[0], q[1], q[2]], [q[1], q[3], q[4]], [q[2], q[4], q[5]]])
    lit = max(0, normal @ matrix @ normal + q[6:9] @ normal + q[9])
    return min(lit * flat[row, col] / 0.4, 1)


def test_a_device_file_gives_the_pictures_of_its_model(device):
    path, lamps, flat = device
    heights = 1e-4 * np.random.default_rng(2).normal(size=(ROWS, COLS))
    normals = gel.normals_of(heights, 2.4e-5)
    found = gel.read_device(path)
    np.testing.assert_allclose(found.flat, flat, atol=1e-12)
    lit = found.shade(normals)
    assert lit.shape == (LAMPS, ROWS, COLS)
    wanted = [[[level(lamps[k], flat[k], i, j, normals[i, j]) for j in range(COLS)]
               for i in range(ROWS)] for k in range(LAMPS)]  # fmt: skip
    np.testing.assert_allclose(lit, wanted, atol=1e-12)
    assert 0.05 < lit.std() and lit.min() == 0 and lit.max() == 1  # both cuts are met
    # A larger picture shows the same field of view.
    up = np.tile([0.0, 0.0, 1.0], (2 * ROWS, 2 * COLS, 1))
    large, small = found.shade(up), found.shade(up[:ROWS, :COLS])
    halved = large.reshape(LAMPS, ROWS, 2, COLS, 2).mean((2, 4))
    assert np.abs(halved - small)[:, 2:-2, 2:-2].mean() < 0.05


def test_normals_are_those_of_a_plane():
    y, x = np.mgrid[:5, :7] * 1e-4
    normals = gel.normals_of(0.3 * x - 0.4 * y, 1e-4)
    np.testing.assert_allclose(normals, np.broadcast_to([-0.3, 0.4, 1] / np.sqrt(1.25), (5, 7, 3)))


def write_heights(path, heights, pixel):
    rows, cols = heights.shape
    path.write_bytes(b"Binary TrueMap Data File v2.0\r\n\0" + b"made here\0"
                     + struct.pack("<iiffff", cols, rows, 1e3 * pixel * cols, 1e3 * pixel * rows,
                                   0, 0) + (1e3 * heights).astype("<f4").tobytes())  # fmt: skip


def test_the_program_draws_a_height_map(device, tmp_path):
    heights = 1e-5 * np.random.default_rng(3).normal(size=(ROWS, COLS))
    write_heights(tmp_path / "map.tmd", heights, 2e-5)
    found, pixel = gel.read_heights(tmp_path / "map.tmd")
    np.testing.assert_allclose(found, heights, atol=1e-10)
    assert pixel == pytest.approx(2e-5, rel=1e-6)
    done = subprocess.run(
        [sys.executable, "-m", "tangere.gel", "shade", device[0], tmp_path / "map.tmd", "-o",
         tmp_path / "drawn"], capture_output=True, text=True, check=True,
    )  # fmt: skip
    assert json.loads(done.stdout)["pictures"] == LAMPS
    assert len(list((tmp_path / "drawn").glob("image0?.png"))) == LAMPS
    (tmp_path / "map.tmd").write_bytes(b"Binary TrueMap Data File v2.0\r\n\0")
    with pytest.raises(tangere.InputError, match="map.tmd: no height map"):
        gel.read_heights(tmp_path / "map.tmd")


def untouched(tmp_path, file):
    """The picture of a scene with this gel, which nothing touches."""
    builder = tangere.SceneBuilder.from_file(tangere.scenes()["rolling_ball_small"])
    builder.sensor.find("tactile", name="pad").picture(gel=file, rows=ROWS, cols=COLS)
    builder.write(tmp_path / "scene.xml", overwrite=True)
    return tangere.Batch(tangere.Model(tangere.Scene(tmp_path / "scene.xml"))).tactile("pad.rgb")[0]


def test_a_device_becomes_a_gel(device, tmp_path):
    said = gel.gel_from_device(device[0], tmp_path / "mine.xml", [2, 4, 6])
    assert 0 < said["rms"] < 40
    flat = gel.read_device(device[0]).shade(np.tile([0.0, 0.0, 1.0], (ROWS, COLS, 1)))
    wanted = np.moveaxis(np.round(255 * flat[[1, 3, 5]]), 0, -1)
    np.testing.assert_array_equal(untouched(tmp_path, "mine.xml"), wanted)
    with pytest.raises(tangere.InputError, match=r"lamps \[1, 2, 7\]; expected 3 of 1 to 6"):
        gel.gel_from_device(device[0], tmp_path / "mine.xml", [1, 2, 7])


def test_a_table_of_taxim_becomes_a_gel(tmp_path):
    # A table of lamps that a gel file can have: level and slopes by place, in B, G, R.
    bins, random = 125, np.random.default_rng(4)
    lamps = random.normal(size=(3, 3, 3)) * [40, 10, 10]  # channel, (nx, ny, nz - 1), (1, x, y)
    angle = (np.arange(bins) + 0.5)[:, None] * 0.5 * np.pi / (bins - 1)
    turn = (np.arange(bins) + 0.5)[None, :] * 2 * np.pi / (bins - 1) - np.pi
    normal = [-np.sin(angle) * np.cos(turn), -np.sin(angle) * np.sin(turn),
              np.cos(angle) - 1 + 0 * turn]  # fmt: skip
    rows, cols, grads = 24, 32, []
    for channel in lamps:
        a, b, d = (sum(channel[k, place] * normal[k] for k in range(3)) for place in range(3))
        level = a + b * (0.5 - cols / 2) / rows + d * (0.5 - rows / 2) / rows
        grads.append(np.stack([0 * a, 0 * a, 0 * a, b / rows, d / rows, level], axis=-1))
    np.savez(tmp_path / "polycalib.npz", bins=bins, grad_r=grads[2], grad_g=grads[1],
             grad_b=grads[0])  # fmt: skip
    background = random.integers(100, 140, (rows, cols, 3)).astype(np.uint8)
    np.save(tmp_path / "bg.npy", background)
    said = gel.gel_from_taxim(tmp_path / "polycalib.npz", tmp_path / "bg.npy",
                              tmp_path / "mine.xml", 1e-4)  # fmt: skip
    assert said["rms"] < 1.5  # the table's angles are steps
    text = (tmp_path / "mine.xml").read_text()
    for name, channel in zip(("red", "green", "blue"), lamps, strict=True):
        line = text[text.index(f"<{name} ") :].partition("/>")[0]
        for shade, numbers in zip(("nx", "ny"), channel, strict=False):
            found = [float(x) for x in line.partition(f'{shade}="')[2].partition('"')[0].split()]
            np.testing.assert_allclose(found, numbers, atol=4)
    np.savez(tmp_path / "pack.npz", f0=background)
    (tmp_path / "bg.npy").unlink()
    again = gel.gel_from_taxim(tmp_path / "polycalib.npz", tmp_path / "pack.npz",
                               tmp_path / "again.xml", 1e-4)  # fmt: skip
    assert again["rms"] == said["rms"]


def test_mistakes_say_what_is_expected(device, tmp_path):
    path = device[0]
    text = path.read_text()
    for old, new, expected in (
        ("rows: 6", "rows: 5", "quadfit of 5 x 60 for 6 lamps"),
        ("nL: 6\nwidth", "width", "'nL'; expected a device file of GelSight"),
        ("scale: [0.4, ", "scale: [", "with 5 scales; expected .24, 48. and 6"),
        ("values: [", "values: [0, ", "quadfit has 361 values; expected 360"),
    ):
        assert old in text
        path.write_text(text.replace(old, new, 1))
        with pytest.raises(tangere.InputError, match=f"device.yaml: .*{expected}"):
            gel.read_device(path)
    path.write_text(text)
    picture = path.with_name("flat.png")
    picture.write_bytes(picture.read_bytes()[:200])
    with pytest.raises(tangere.InputError, match="flat.png: damaged"):
        gel.read_device(path)
    np.savez(tmp_path / "polycalib.npz", bins=3, grad_r=np.zeros((3, 3, 6)))
    np.save(tmp_path / "bg.npy", np.zeros((4, 4, 3)))
    with pytest.raises(tangere.InputError, match="grad_g.*expected polycalib.npz of Taxim"):
        gel.gel_from_taxim(
            tmp_path / "polycalib.npz", tmp_path / "bg.npy", tmp_path / "a.xml", 1e-4
        )
    assert not (tmp_path / "a.xml").exists()
