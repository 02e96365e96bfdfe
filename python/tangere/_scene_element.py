# SPDX-License-Identifier: Apache-2.0
"""Elements of a scene as objects: the base of the classes that the schema gives."""

from __future__ import annotations

import sys
from pathlib import Path
from typing import Any, Iterator, Sequence, TypeAlias, TypeVar, Union
from xml.sax.saxutils import quoteattr

import numpy as np
from numpy.typing import NDArray

from . import _core

Value: TypeAlias = Union[
    str, float, np.number, NDArray[Any], Sequence[float], Sequence[Sequence[float]],
    Sequence[str], None,
]  # fmt: skip
Origin: TypeAlias = tuple[str, int]  # a file and a line
E = TypeVar("E", bound="Element")
_REFERRING = ("randomize", "initial")  # sections whose elements name other ones
_LISTED = 8  # elements in a message, at most
_PACKAGE = str(Path(__file__).parent)


class Element:
    """An element of a scene. `attributes`: their text by name. `inside`: elements in it.
    `origin`: the file and the line that made it, which messages name."""

    def __init__(self, tag: str, attributes: dict[str, str], origin: Origin) -> None:
        self.tag, self.attributes, self.origin = tag, attributes, origin
        self.inside: list[Element] = []

    def set(self, **attributes: Value) -> None:
        """Gives attributes other values, as the call that made the element takes them. None
        leaves an attribute out."""
        self.origin = _caller()
        for name in attributes:
            self.attributes.pop(name, None)
        self.attributes |= self._texts(attributes)

    def _texts(self, given: dict[str, Any]) -> dict[str, str]:
        return {
            name: _text(value, f"{_at(self.origin)}<{self.tag}>: {name}")
            for name, value in given.items()
            if value is not None
        }

    def _all(self) -> Iterator[Element]:
        for child in self.inside:
            yield child
            yield from child._all()

    def _described(self) -> Iterator[tuple[Element, dict[str, str]]]:
        """The elements inside, but not what refers to them, and their attributes with the names
        that they have without one."""
        for child in self.inside:
            usual = None
            if self.tag == "link" and child.tag == "body":
                usual = self.attributes.get("name")
            if self.tag == "sensor":
                usual = child.attributes.get("body")
            yield child, ({} if usual is None else {"name": usual}) | child.attributes
            if child.tag not in _REFERRING:
                yield from child._described()

    def _lines(self, indent: str = "") -> Iterator[tuple[str, Origin]]:
        """The lines of the element in a file, and where each comes from."""
        if not self.inside:
            if self.origin[1]:  # not a section that nothing was put in
                yield f"{indent}<{self._start()}/>", self.origin
            return
        made = [e.origin for e in (self, *self._all()) if e.origin[1]]
        origin = made[0] if made else self.origin
        yield f"{indent}<{self._start()}>", origin
        for child in self.inside:
            yield from child._lines(indent + "  ")
        yield f"{indent}</{self.tag}>", origin

    def _start(self) -> str:
        return " ".join([self.tag, *(f"{k}={quoteattr(v)}" for k, v in self.attributes.items())])

    def __repr__(self) -> str:
        return f"<{self._start()}>"


class Piece(Element):
    """A comment or a text between elements, `xml`."""

    def __init__(self, xml: str, origin: Origin) -> None:
        super().__init__("", {}, origin)
        self.xml = xml

    def _lines(self, indent: str = "") -> Iterator[tuple[str, Origin]]:
        return ((line, self.origin) for line in (indent + self.xml).split("\n"))

    def __repr__(self) -> str:
        return self.xml


class Holder(Element):
    """An element that holds others."""

    def include(self, file: str | Path, **attributes: Value) -> None:
        """Adds `<include>`: what a file beside the scene holds stands in its place.

        Parameters
        ----------
        file: its root has the name of this element.
        attributes: take the place of those of the elements that it brings in.
        """
        self._add(Element, "include", {"file": str(file), **attributes})

    def find(self, tag: str, **attributes: Value) -> Element:
        """The element of a kind that has these attributes, however deep inside this one:
        `find("joint", name="lift")`. A body without a name has that of its link, a sensor that of
        its body. What `<randomize>` and `<initial>` hold is found from there alone:
        `b.randomize.find("tactile", name="pad")`. Raises InputError if there is none, or more than
        one."""
        wanted = self._texts(attributes)
        of_tag = [(e, named) for e, named in self._described() if e.tag == tag]
        found = [e for e, named in of_tag if wanted.items() <= named.items()]
        if len(found) == 1:
            return found[0]
        sought = f"{Element(tag, wanted, self.origin)} inside <{self.tag}>"
        if found:
            listed = "".join(f"\n  {_at(e.origin)}{e}" for e in found[:_LISTED])
            more = f"\n  and {len(found) - _LISTED} more" if len(found) > _LISTED else ""
            raise _core.InputError(
                f"{len(found)} elements are {sought}; expected one, by more attributes, or in a "
                f"holder that has one:{listed}{more}"
            )
        near = ""
        if len(wanted) == 1:
            ((name, value),) = wanted.items()
            there = [named[name] for _, named in of_tag if name in named]
            near = _core.suggestion(value, there) if there else ""
        raise _core.InputError(f"no {sought}{near}")

    def clear(self) -> None:
        """Takes out everything that the element holds."""
        self.inside.clear()

    def _add(self, kind: type[E], tag: str, given: dict[str, Any], once: bool = False) -> E:
        """Adds an element with the arguments of a call; `once`: or sets those of the one that is
        there."""
        given.pop("self", None)
        element = kind(tag, {}, _caller())
        if unknown := given.pop("unknown", {}):
            wrong = next(iter(unknown))
            raise _core.InputError(
                f"{_at(element.origin)}<{tag}>: unknown attribute '{wrong}'"
                f"{_core.suggestion(wrong, list(given))}"
            )
        element.attributes = element._texts(given)
        there = [e for e in self.inside if isinstance(e, kind) and e.tag == tag] if once else []
        if not there:
            self.inside.append(element)
            return element
        there[0].attributes |= element.attributes
        there[0].origin = element.origin
        return there[0]

    def _section(self, kind: type[E], tag: str) -> E:
        """The last section of this name, or a new one."""
        for child in reversed(self.inside):
            if isinstance(child, kind) and child.tag == tag:
                return child
        section = kind(tag, {}, ("", 0))
        self.inside.append(section)
        return section


def _caller() -> Origin:
    """The line outside the package that called it."""
    frame = sys._getframe(1)
    while frame.f_back is not None and frame.f_code.co_filename.startswith(_PACKAGE):
        frame = frame.f_back
    return frame.f_code.co_filename, frame.f_lineno


def _at(origin: Origin) -> str:
    return f"{origin[0]}:{origin[1]}: " if origin[1] else ""


def _text(value: Any, what: str) -> str:
    """A value as the text of an attribute. Reading a number gives the same bits."""
    if isinstance(value, str):
        return value
    if isinstance(value, (list, tuple)) and value and all(isinstance(v, str) for v in value):
        return ",".join(value)
    try:
        numbers = np.asarray(value)
    except ValueError:  # rows of different lengths
        numbers = np.empty(0, object)
    if numbers.ndim == 0 and numbers.dtype == bool:
        return "true" if numbers else "false"
    if numbers.dtype.kind not in "iuf":
        raise _core.InputError(
            f"{what}={value!r}; expected text, a number, True or False, or numbers in a sequence"
        )
    return " ".join(repr(x).removesuffix(".0") for x in numbers.ravel().tolist())
