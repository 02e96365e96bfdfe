# SPDX-License-Identifier: Apache-2.0
"""Calibrations of camera gels that others made: GelSight's device files and tables of Taxim.

    python -m tangere.gel device series1.yaml -o my_gel.xml --lamps 1 3 5
    python -m tangere.gel taxim polycalib.npz --background real_bg.npy -o my_gel.xml --pixel 2.95e-5
    python -m tangere.gel shade series1.yaml heightmap.tmd -o drawn

The first two write a gel file and its background, for `<picture gel="my_gel.xml"/>`
(docs/pictures.md). The last one draws a height map as the device's own model does.

A device has n lamps and a grey camera. With the normal N of the surface, lamp k gives

    max(0, Nᵀ A_k N + b_kᵀ N + c_k) F_k / s_k,    at most 1

where A, b and c are polynomials of the place, F is a picture of the flat gel and s its scale. A
table of Taxim has, for each angle and direction of the slope, a polynomial of the pixel: the
difference to the background. A gel file has 8 functions of the normal, each with a level and two
slopes over the place, so both are fitted to it by least squares, and the rest is printed.
"""

from __future__ import annotations

import argparse
import json
import struct
import zlib
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Sequence

import numpy as np
from numpy.typing import NDArray

from . import _core
from ._png import png

Numbers = NDArray[np.float64]

_STEEPEST = 1.2  # largest slope that a gel is fitted to; a ball's imprint has 0.5 to 1
_RINGS, _TURNS, _PLACES = 13, 24, 11  # of normals: slopes and directions; of places: a side
_EDGE = 0.1  # of the picture's sides; nearer to them tables extrapolate
_SHADES = ("nx", "ny", "nz", "nxx", "nxy", "nyy", "nxz", "nyz")
_CHANNELS = ("red", "green", "blue")
_LEAST_SCALE, _DARKEST = 1e-3, 1 / 255  # of the maker's model


@dataclass
class GelSightDevice:
    """A device file of GelSight, with its picture of the flat gel."""

    lamps: Numbers  #: (n, places, 10): A00 A01 A02 A11 A12 A22 b0 b1 b2 c, by powers of the place
    flat: Numbers  #: (n, rows, cols), 0 to 1; empty: the file names no picture
    scale: Numbers  #: (n): its level in the middle
    size: tuple[int, int]  #: rows and columns of the camera
    pixel: float  #: of the camera [m]

    def shade(self, normals: Numbers) -> Numbers:
        """(n, rows, cols), 0 to 1: what the device gives for normals (rows, cols, 3) of length 1.
        A picture of fewer pixels shows the same field of view."""
        rows, cols = normals.shape[:2]
        smaller = min(rows, cols)
        y = ((np.arange(rows) - (rows + 1) / 2) / smaller)[:, None]
        x = ((np.arange(cols) - (cols + 1) / 2) / smaller)[None, :]
        lit = [self._lit(k, x, y, normals) for k in range(len(self.lamps))]
        if self.flat.size:
            flats = [_resized(np.maximum(flat, _DARKEST), (rows, cols)) for flat in self.flat]
            lit = [
                light / (scale / flat)
                for light, flat, scale in zip(lit, flats, self.scale, strict=True)
            ]
        return np.minimum(np.stack(lit), 1)

    def _lit(self, lamp: int, x: Any, y: Any, normals: Numbers) -> Numbers:
        """Lamp `lamp` before the flat field."""
        powers = _powers(x, y, self.lamps.shape[1])
        nx, ny, nz = np.moveaxis(normals, -1, 0)
        of = np.tensordot(np.moveaxis(self.lamps[lamp], 0, -1), powers, 1)  # (terms, …)
        square = of[0] * nx * nx + of[3] * ny * ny + of[5] * nz * nz
        square += 2 * (of[1] * nx * ny + of[2] * nx * nz + of[4] * ny * nz)
        light: Numbers = square + of[6] * nx + of[7] * ny + of[8] * nz + of[9]
        if len(of) > 10:
            light = light * np.maximum(of[10], _LEAST_SCALE)
        return np.maximum(light, 0)


def read_device(path: str | Path) -> GelSightDevice:
    """A device file (YAML) of GelSight, and the picture of the flat gel that it names.

    Raises InputError for a file that has no `quadfit` or contradicts itself, OSError for one that
    cannot be read.
    """
    path = Path(path)
    said = _sections(path)
    top, fit, field = said[""], said.get("quadfit", {}), said.get("flatfield", {})
    try:
        count = int(top["nL"])
        size = (int(top["height"]), int(top["width"]))
        pixel = 1e-3 * float(top["mmperpixel"])
        rows, cols = int(fit["rows"]), int(fit["cols"])
        values = _list(fit["values"])
    except (KeyError, ValueError) as error:
        raise _core.InputError(
            f"{path}: {error}; expected a device file of GelSight, with nL, width, height, "
            "mmperpixel and quadfit of rows, cols and values"
        ) from None
    if count < 1 or rows not in (1, 3, 6, 10, 15, 21, 28) or cols not in (10 * count, 11 * count):
        raise _core.InputError(
            f"{path}: quadfit of {rows} x {cols} for {count} lamps; expected 1, 3, 6, 10, 15, 21 "
            f"or 28 rows and {10 * count} or {11 * count} columns"
        )
    if len(values) != rows * cols or not np.isfinite(values).all():
        raise _core.InputError(
            f"{path}: quadfit has {len(values)} values; expected {rows * cols} finite numbers"
        )
    lamps = values.reshape(rows, count, -1).transpose(1, 0, 2)
    flat, scale = _flat_field(path, field, count) if field else (np.empty((0, 0, 0)), np.ones(0))
    return GelSightDevice(lamps, flat, scale, size, pixel)


def read_heights(path: str | Path) -> tuple[Numbers, float]:
    """Heights (rows, cols) [m] of a TMD file of GelSight, and the side of a pixel [m]."""
    data = Path(path).read_bytes()
    begin = data.find(b"\0") + 1
    end = data.find(b"\0", begin) + 1  # behind a comment
    if not data.startswith(b"Binary TrueMap Data File") or end <= 0 or len(data) < end + 24:
        raise _core.InputError(f"{path}: no height map; expected a TMD file of version 2")
    cols, rows, width, _height, _x, _y = struct.unpack("<iiffff", data[end : end + 24])
    if min(rows, cols) < 2 or len(data) != end + 24 + 4 * rows * cols:
        raise _core.InputError(f"{path}: {len(data)} bytes for {rows} x {cols} heights")
    heights = np.frombuffer(data, "<f4", offset=end + 24).reshape(rows, cols)
    return heights.astype(float) * 1e-3, 1e-3 * width / cols


def normals_of(heights: Numbers, pixel: float) -> Numbers:
    """(rows, cols, 3): normals of a height map (rows, cols) [m] by central differences."""
    along, across = np.gradient(heights, pixel)
    normals = np.stack([-across, -along, np.ones_like(heights)], axis=-1)
    unit: Numbers = normals / np.linalg.norm(normals, axis=-1, keepdims=True)
    return unit


def gel_from_device(
    path: str | Path, output: str | Path, lamps: Sequence[int] = (1, 3, 5),
    overwrite: bool = False,
) -> dict[str, Any]:  # fmt: skip
    """Writes a gel file whose R, G and B are three lamps of a device, counted from 1.

    Returns {"rms": of the fit [grey levels], "output": path}. The background beside it is the flat
    gel under these lamps. Files that exist are kept unless `overwrite`: an InputError says so.
    """
    device = read_device(path)
    if len(lamps) != 3 or not all(1 <= k <= len(device.lamps) for k in lamps):
        raise _core.InputError(f"lamps {list(lamps)}; expected 3 of 1 to {len(device.lamps)}")
    rows, cols = device.flat.shape[1:] if device.flat.size else (240, 320)
    chosen = [k - 1 for k in lamps]
    flat = np.zeros((rows, cols, 3))
    flat[..., 2] = 1
    background = 255 * np.moveaxis(device.shade(flat)[chosen], 0, -1)

    def levels(normal: Numbers, row: Numbers, col: Numbers) -> Numbers:
        smaller = min(rows, cols)
        x, y = (col - (cols + 1) / 2) / smaller, (row - (rows + 1) / 2) / smaller
        up = np.broadcast_to([0.0, 0.0, 1.0], normal.shape)
        bright = []
        for c, k in enumerate(chosen):
            lit, at_rest = device._lit(k, x, y, normal), device._lit(k, x, y, up)
            there = background[row.astype(int), col.astype(int), c]
            bright.append(np.minimum(there * lit / np.maximum(at_rest, 1e-9), 255) - there)
        return np.stack(bright, axis=-1)

    notes = {"device": Path(path).stem, "lamps": " ".join(map(str, lamps))}
    pixel = device.pixel * device.size[1] / cols
    return _write_gel(Path(output), levels, background, pixel, notes, overwrite)


def gel_from_taxim(
    table: str | Path, background: str | Path, output: str | Path, pixel: float,
    order: str = "bgr", overwrite: bool = False,
) -> dict[str, Any]:  # fmt: skip
    """Writes a gel file from a table of Taxim and a picture of the untouched gel.

    Parameters
    ----------
    table: polycalib.npz with bins, grad_r, grad_g and grad_b, (bins, bins, 6) each.
    background: (rows, cols, 3) as NPY, or an NPZ file with `f0`, such as dataPack.npz.
    pixel: side of a pixel of the background [m].
    order: of the channels of both, "bgr" as OpenCV reads pictures, or "rgb".
    overwrite: replace files that exist, which is an InputError otherwise.

    Returns {"rms": of the fit [grey levels], "output": path}. Taxim's blur of the background and
    its shadows are not taken over.
    """
    if order not in ("bgr", "rgb"):
        raise _core.InputError(f"order {order!r}; expected 'bgr' or 'rgb'")
    try:
        with np.load(table) as stored:
            grads = np.stack([stored[f"grad_{c}"] for c in "rgb"], axis=-1).astype(float)
        with open(background, "rb") as file:
            given = np.load(file, allow_pickle=False)
            picture = given if isinstance(given, np.ndarray) else given["f0"]
            picture = np.asarray(picture, float)
    except (KeyError, ValueError, EOFError, zlib.error) as error:
        raise _core.InputError(
            f"{table}, {background}: {error}; expected polycalib.npz of Taxim with grad_r, grad_g "
            "and grad_b, and a picture as NPY or NPZ with f0"
        ) from None
    bins = grads.shape[0]
    if grads.shape != (bins, bins, 6, 3) or bins < 3 or not np.isfinite(grads).all():
        raise _core.InputError(
            f"{table}: tables of shape {grads.shape[:-1]}; expected (bins, bins, 6), finite"
        )
    if picture.ndim != 3 or picture.shape[2] != 3:
        raise _core.InputError(f"{background}: shape {picture.shape}; expected (rows, cols, 3)")
    if order == "bgr":
        grads, picture = grads[..., ::-1], picture[..., ::-1]

    def levels(normal: Numbers, row: Numbers, col: Numbers) -> Numbers:
        angle = np.arccos(np.clip(normal[..., 2], -1, 1))
        turn = np.arctan2(-normal[..., 1], -normal[..., 0])  # of the slope
        i = np.minimum((angle / (0.5 * np.pi / (bins - 1))).astype(int), bins - 1)
        j = np.minimum(((turn + np.pi) / (2 * np.pi / (bins - 1))).astype(int), bins - 1)
        powers = np.stack([col**2, row**2, row * col, col, row, np.ones_like(col)], axis=-1)
        found: Numbers = np.einsum("...k,...kc->...c", powers, grads[i, j])
        there = picture[row.astype(int), col.astype(int)]
        return np.clip(found, -there, 255 - there)

    return _write_gel(Path(output), levels, picture, pixel, {"table": Path(table).stem}, overwrite)


def _write_gel(
    output: Path, levels: Any, background: Numbers, pixel: float, notes: dict[str, str],
    overwrite: bool,
) -> dict[str, Any]:  # fmt: skip
    """Fits lamps to `levels(normals, rows, cols)`, differences to the background (…, 3), and writes
    the files."""
    if not 0 < pixel <= 0.01:
        raise _core.InputError(f"pixel {pixel}; expected the side of a pixel [m]")
    beside = output.with_name(f"{output.stem}_background.png")
    for path in (output, beside):
        if path.exists() and not overwrite:
            raise _core.InputError(f"{path} exists; expected another name, or to overwrite it")
    rows, cols, _ = background.shape
    lamps, rms = fit_lamps(levels, (rows, cols))
    picture = np.clip(np.round(background), 0, 255).astype(np.uint8)
    lines = [f'<gel background="{beside.name}" pixel="{pixel:.6g}" blur="0">']
    said = " ".join(f'{name}="{_quoted(text)}"' for name, text in notes.items())
    lines.append(f'  <fit {said} rms="{rms:.2f}"/>')
    for name, shades in zip(_CHANNELS, lamps, strict=True):
        numbers = " ".join(
            f'{shade}="{a:.6g} {b:.6g} {d:.6g}"'
            for shade, (a, b, d) in zip(_SHADES, shades, strict=True)
        )
        lines.append(f"  <{name} {numbers}/>")
    beside.write_bytes(png(picture))
    output.write_text("\n".join([*lines, "</gel>"]) + "\n", encoding="utf-8")
    return {"rms": rms, "output": str(output)}


def fit_lamps(levels: Any, size: tuple[int, int]) -> tuple[Numbers, float]:
    """The lamps of a gel file, (3, 8, 3), that come nearest to `levels(normals, rows, cols)` in
    least squares, and the root mean square of what is left [grey levels].

    It is called with normals (n, 3) of slopes up to 1.2 in all directions and with places in a
    picture of `size` rows and columns, (n) each, and returns differences to the background (n, 3).
    """
    rows, cols = size
    slope = np.linspace(0.05, _STEEPEST, _RINGS)
    turn = np.linspace(-np.pi, np.pi, _TURNS, endpoint=False)
    row, col = (np.linspace(_EDGE, 1 - _EDGE, _PLACES) * n - 0.5 for n in size)
    s, t, i, j = (a.ravel() for a in np.meshgrid(slope, turn, row, col, indexing="ij"))
    p, q = s * np.cos(t), s * np.sin(t)
    length = np.sqrt(1 + s * s)
    nx, ny, nz = -p / length, -q / length, 1 / length
    wanted = levels(np.stack([nx, ny, nz], axis=-1), i, j)
    phi = [nx, ny, nz - 1, nx * nx, nx * ny, ny * ny, nx * nz, ny * nz]
    smaller = min(rows, cols)
    x, y = (j + 0.5 - cols / 2) / smaller, (i + 0.5 - rows / 2) / smaller
    design = np.stack([f * g for f in phi for g in (np.ones_like(x), x, y)], axis=-1)
    found, *_ = np.linalg.lstsq(design, wanted, rcond=None)
    rms = float(np.sqrt(((design @ found - wanted) ** 2).mean()))
    return found.T.reshape(3, len(_SHADES), 3), rms


def _powers(x: Any, y: Any, count: int) -> Numbers:
    """(count, …): powers of the place, highest degree first, x falling."""
    degree = {1: 0, 3: 1, 6: 2, 10: 3, 15: 4, 21: 5, 28: 6}[count]
    terms = [x ** (d - k) * y**k for d in range(degree, -1, -1) for k in range(d + 1)]
    return np.stack([np.broadcast_to(t, np.broadcast(x, y).shape) for t in terms])


def _sections(path: Path) -> dict[str, dict[str, str]]:
    """Keys of a device file by section; those without one under ""."""
    found: dict[str, dict[str, str]] = {"": {}}
    section = ""
    for line in path.read_text(encoding="utf-8", errors="replace").splitlines():
        key, colon, value = line.partition(":")
        if not colon or line.lstrip().startswith("-"):
            continue
        if not line[0].isspace():
            section = key.strip()
            found[""][section] = value.strip()
        else:
            found.setdefault(section, {})[key.strip()] = value.strip()
    return found


def _list(text: str) -> Numbers:
    return np.array([float(word) for word in text.strip("[]() ").split(",")])


def _flat_field(path: Path, field: dict[str, str], count: int) -> tuple[Numbers, Numbers]:
    """Pictures of the flat gel (n, rows, cols), three beside each other, and their scales (n)."""
    try:
        cols, rows = (int(x) for x in _list(field["modelsize"]))
        scale = _list(field["scale"])
        name = field["modelfile"]
    except (KeyError, ValueError) as error:
        raise _core.InputError(
            f"{path}: flatfield without {error}; expected modelfile, modelsize and scale"
        ) from None
    all_of_them = _grey_png(path.parent / name)
    down = -(-count // 3)
    if all_of_them.shape != (down * rows, 3 * cols) or len(scale) != count:
        raise _core.InputError(
            f"{path}: flat field of {all_of_them.shape} with {len(scale)} scales; expected "
            f"({down * rows}, {3 * cols}) and {count}"
        )
    tiles = all_of_them.reshape(down, rows, 3, cols).swapaxes(1, 2)
    return tiles.reshape(-1, rows, cols)[:count], scale


def _resized(picture: Numbers, size: tuple[int, int]) -> Numbers:
    """A picture of other rows and columns, by the cubic of Keys; weights reach farther where it
    shrinks."""
    for axis, new in enumerate(size):
        old = picture.shape[axis]
        if old == new:
            continue
        step = old / new
        wide = max(step, 1.0)
        middle = (np.arange(new) + 0.5) * step - 0.5
        first = np.floor(middle - 2 * wide).astype(int)
        at = first[:, None] + np.arange(int(np.ceil(4 * wide)) + 2)
        far = np.abs(at - middle[:, None]) / wide
        near = (1.5 * far - 2.5) * far**2 + 1
        outer = ((-0.5 * far + 2.5) * far - 4) * far + 2
        weight = np.where(far <= 1, near, np.where(far <= 2, outer, 0))
        weight /= weight.sum(axis=1, keepdims=True)
        mirrored = np.where(at < 0, -1 - at, np.where(at >= old, 2 * old - 1 - at, at))
        mirrored = np.clip(mirrored, 0, old - 1)
        matrix = np.zeros((new, old))
        np.add.at(matrix, (np.arange(new)[:, None], mirrored), weight)
        picture = matrix @ picture if axis == 0 else picture @ matrix.T
    return picture


def _grey_png(path: Path) -> Numbers:
    """A grey PNG of 8 or 16 bits, (rows, cols), 0 to 1, without any gamma."""
    data = path.read_bytes()
    chunks, at = [], 8
    while at + 8 <= len(data):
        size, kind = struct.unpack(">I4s", data[at : at + 8])
        chunks.append((kind, data[at + 8 : at + 8 + size]))
        at += size + 12
    head = dict(chunks[:1]).get(b"IHDR", b"")
    if not data.startswith(b"\x89PNG") or len(head) != 13:
        raise _core.InputError(f"{path}: no PNG file")
    cols, rows, bits, colour, _, _, interlaced = struct.unpack(">IIBBBBB", head)
    if bits not in (8, 16) or colour != 0 or interlaced:
        raise _core.InputError(
            f"{path}: {bits} bits of colour type {colour}; expected grey of 8 or 16, not interlaced"
        )
    step = bits // 8
    try:
        packed = zlib.decompress(b"".join(part for kind, part in chunks if kind == b"IDAT"))
    except zlib.error as error:
        raise _core.InputError(f"{path}: damaged: {error}") from None
    if len(packed) != rows * (1 + cols * step):
        raise _core.InputError(f"{path}: damaged: {len(packed)} bytes of pixels")
    lines = np.frombuffer(packed, np.uint8).reshape(rows, -1)
    pixels = np.empty((rows, cols * step), np.uint8)
    above = np.zeros(cols * step, np.uint8)
    for k, line in enumerate(lines):
        above = pixels[k] = _unfiltered(int(line[0]), line[1:], above, step, path)
    values = pixels.view(">u2" if bits == 16 else np.uint8).astype(float)
    return values / (2**bits - 1)


def _unfiltered(
    kind: int, line: NDArray[np.uint8], above: NDArray[np.uint8], step: int, path: Path
) -> NDArray[np.uint8]:
    """A line of a PNG before its filter."""
    if kind == 0:
        return line
    if kind == 2:
        return line + above
    if kind == 1:
        sums = np.cumsum(line.reshape(-1, step), axis=0, dtype=np.uint8)
        return sums.ravel()
    if kind not in (3, 4):
        raise _core.InputError(f"{path}: damaged: filter {kind} of a line")
    given, up = line.tolist(), above.tolist()
    out = [0] * (len(given) + step)  # zeros before the line
    corner = [0] * step + up
    for n, byte in enumerate(given):
        a, b, c = out[n], up[n], corner[n]
        if kind == 3:
            guess = (a + b) // 2
        else:
            far_a, far_b, far_c = abs(b - c), abs(a - c), abs(a + b - 2 * c)
            guess = a if far_a <= far_b and far_a <= far_c else b if far_b <= far_c else c
        out[n + step] = (byte + guess) & 255
    return np.array(out[step:], np.uint8)


def _grey_file(levels: NDArray[np.uint8]) -> bytes:
    return png(np.repeat(levels[..., None], 3, axis=-1))


def _quoted(text: str) -> str:
    for sign, name in (("&", "&amp;"), ("<", "&lt;"), ('"', "&quot;")):
        text = text.replace(sign, name)
    return text


def _arguments() -> argparse.Namespace:
    parser = argparse.ArgumentParser(prog="tangere.gel", description=__doc__.splitlines()[0])
    ways = parser.add_subparsers(dest="way", required=True)
    device = ways.add_parser("device", help="a gel file from a device file of GelSight")
    device.add_argument("file", type=Path, help="device file, YAML")
    device.add_argument("--lamps", type=int, nargs=3, default=[1, 3, 5],
                        help="those that become R, G and B, counted from 1")  # fmt: skip
    taxim = ways.add_parser("taxim", help="a gel file from a table of Taxim")
    taxim.add_argument("file", type=Path, help="polycalib.npz")
    taxim.add_argument("--background", type=Path, required=True, help="NPY, or NPZ with f0")
    taxim.add_argument("--pixel", type=float, required=True, help="its side [m]")
    taxim.add_argument("--order", default="bgr", help="of channels: bgr or rgb")
    shade = ways.add_parser("shade", help="the pictures of a device of a height map")
    shade.add_argument("file", type=Path, help="device file, YAML")
    shade.add_argument("heights", type=Path, help="height map, TMD")
    for way in (device, taxim, shade):
        what = "folder for the pictures" if way is shade else "gel file to write, XML"
        way.add_argument("-o", "--output", type=Path, required=True, help=what)
        if way is not shade:
            way.add_argument("--overwrite", action="store_true", help="replace files that exist")
    return parser.parse_args()


def main() -> None:
    """The program `python -m tangere.gel`."""
    args = _arguments()
    try:
        if args.way == "shade":
            heights, pixel = read_heights(args.heights)
            lit = read_device(args.file).shade(normals_of(heights, pixel))
            args.output.mkdir(exist_ok=True)
            for k, picture in enumerate(np.round(255 * lit).astype(np.uint8), 1):
                (args.output / f"image{k:02}.png").write_bytes(_grey_file(picture))
            print(json.dumps({"output": str(args.output), "pictures": len(lit)}))
        elif args.way == "device":
            print(json.dumps(gel_from_device(args.file, args.output, args.lamps, args.overwrite)))
        else:
            print(json.dumps(gel_from_taxim(args.file, args.background, args.output, args.pixel,
                                            args.order, args.overwrite)))  # fmt: skip
    except (_core.InputError, OSError) as error:
        raise SystemExit(f"tangere.gel: {error}") from None


if __name__ == "__main__":
    main()
