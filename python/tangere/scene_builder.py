# SPDX-License-Identifier: Apache-2.0
"""Scenes without files: elements as objects, with the names and the checks of scene files.

    b = tangere.SceneBuilder("drop", timestep=2e-3, integrator="BDF2")
    b.ground()
    ball = b.robot.link("ball")
    ball.joint("ball", "free3d", pos=(0, 0, 0.05))
    ball.body("sphere", radius=0.02, density=800)
    b.contact.surface_contact("ball", "ground", kn=2e8, kt=2e5, mu=0.8, damping=2e8)
    model = tangere.Model(b.scene())
"""

from __future__ import annotations

from pathlib import Path
from xml.parsers import expat
from xml.sax.saxutils import escape

from . import _core
from ._scene_element import Element, Holder, Origin, Piece, Value
from .scene_elements import INSIDE, SceneElements

__all__ = ["Element", "Holder", "SceneBuilder"]


class SceneBuilder(SceneElements):
    """A scene that Python builds.

    Parameters
    ----------
    name: of the scene.
    folder: what the scene names, such as meshes, is looked for beside a file in this folder.
    unit: "m-kg" or "cm-g", of all numbers. Units in docstrings are those of "m-kg".
    option: gravity, timestep, integrator: more attributes of `<option>`.

    Methods have the names of elements, their arguments those of attributes. `b.contact`,
    `b.sensor` and so on are the sections of a scene file. Elements that hold others, such as links,
    have methods for these. [Scenes](scenes.md) describes all of them, and so does `help`. Numbers
    may be of any type, and sequences arrays. None leaves an attribute out.

    InputError: at once for an unknown attribute, from `scene()` for whatever the reader of scene
    files refuses. The message has the file and the line that made the element.
    """

    def __init__(
        self, name: str = "scene", *, folder: str | Path = ".", unit: str = "m-kg", **option: Value
    ) -> None:
        super().__init__("tangere", {"model": name}, ("", 0))
        self.name, self.folder = name, Path(folder)
        self._before: list[Piece] = []  # comments before the root
        self.option(unit=unit, **option)  # type: ignore[arg-type]

    @classmethod
    def from_file(cls, path: str | Path) -> SceneBuilder:
        """A scene file as a builder, to change it or to add to it. Comments stay. Raises InputError
        if it is no XML, OSError if it cannot be read."""
        return cls.from_string(Path(path).read_text(encoding="utf-8"), path)

    @classmethod
    def from_string(cls, text: str, name: str | Path = "scene") -> SceneBuilder:
        """The same for text. `name` stands for the file: messages have it, and what the scene names
        is looked for beside it."""
        builder = cls(Path(name).stem, folder=Path(name).parent)
        builder.inside.clear()
        _read(text, str(name), builder)
        return builder

    def scene(self) -> _core.Scene:
        """Reads what was built as a scene file is read. Raises what Scene raises, and its
        UserWarnings."""
        return self._scene(self.folder / self.name)

    def xml(self) -> str:
        """The text of the scene file."""
        return "".join(line + "\n" for line, _ in self._file_lines())

    def write(self, path: str | Path, *, overwrite: bool = False) -> None:
        """Writes the scene file, whole or not at all. Raises InputError or OSError, before anything
        is written, if the scene cannot be read there: what it names is looked for beside `path`."""
        if not overwrite and Path(path).exists():
            raise _core.IoError(f"'{path}' exists already; give overwrite=True to replace it")
        self._scene(Path(path))
        _core.write_text(str(path), self.xml(), overwrite)

    def _scene(self, path: Path) -> _core.Scene:
        return _core.parse_scene(self.xml(), str(path), [at for _, at in self._file_lines()])

    def _file_lines(self) -> list[tuple[str, Origin]]:
        return [line for part in (*self._before, self) for line in part._lines()]


def _read(text: str, name: str, root: SceneBuilder) -> None:
    """Fills a builder with the elements of a text."""
    parser = expat.ParserCreate()
    open_elements: list[Element] = []

    def start(tag: str, attributes: dict[str, str]) -> None:
        origin = (name, parser.CurrentLineNumber)
        if not open_elements:
            root.tag, root.attributes, root.origin = tag, attributes, origin
            open_elements.append(root)
            return
        parent = open_elements[-1]
        known = INSIDE.get("tangere" if parent is root else parent.tag, {})
        element = known.get(tag, Element)(tag, attributes, origin)
        parent.inside.append(element)
        open_elements.append(element)

    def piece(xml: str) -> None:
        made = Piece(xml, (name, parser.CurrentLineNumber))
        if open_elements:
            open_elements[-1].inside.append(made)
        elif not root.inside:
            root._before.append(made)

    def data(words: str) -> None:
        if words.strip():
            piece(escape(words.strip()))

    parser.StartElementHandler = start
    parser.EndElementHandler = lambda _: open_elements.pop()
    parser.CommentHandler = lambda words: piece(f"<!--{words}-->")
    parser.CharacterDataHandler = data
    try:
        parser.Parse(text, True)
    except expat.ExpatError as e:
        why = expat.ErrorString(e.code)
        raise _core.InputError(f"{name}:{e.lineno}: not well-formed XML: {why}") from None
