# SPDX-License-Identifier: Apache-2.0
"""Writes tangere/scene_elements.py, the classes that build scenes, from the schema of scenes.

    PYTHONPATH=FOLDER_OF_CORE python python/scene_elements.py OUTPUT

Each element that holds others becomes a class, each element inside it a method, and each attribute
an argument, so that editors, help() and type checkers have them all. The build runs it.
"""

from __future__ import annotations

import sys
from pathlib import Path
from typing import Any, Iterator

import _core  # type: ignore[import-not-found]  # without the package, which needs the output

HEAD = '''# SPDX-License-Identifier: Apache-2.0
# Made by python/scene_elements.py from the schema of scenes.
"""Elements of scenes, one class for each that holds others. `SceneBuilder` is the root."""

from __future__ import annotations

from typing import Literal, NoReturn

from ._scene_element import Element, Holder, Value

__all__ = {names}
'''
SEE = {"see below": "see docs/scenes.md", "see contact.md": "see docs/contact.md"}


def main() -> None:
    schema = _core.scene_schema()
    root, *others = schema
    names = [class_name(holder["name"]) for holder in [*others, root]]
    lines = [HEAD.format(names=names), *class_of(root, [h for h in others if h["section"]])]
    for holder in others:
        lines += class_of(holder, [])
    lines += ["", "", "INSIDE: dict[str, dict[str, type[Element]]] = {"]
    for holder in schema:
        known = {e["name"]: kind_of(e) for e in holder["elements"]}
        if holder is root:
            known |= {h["name"]: class_name(h["name"]) for h in others if h["section"]}
        words = ", ".join(f'"{name}": {kind}' for name, kind in known.items())
        lines.append(f'    "{holder["name"]}": {{{words}}},')
    Path(sys.argv[1]).write_text("\n".join([*lines, "}", ""]), encoding="utf-8")


def class_name(holder: str) -> str:
    return "SceneElements" if holder == "tangere" else holder.capitalize()


# Attributes that come first although others may stand in their place. None leaves them out, and is
# what they are at the end of those without a name.
LEADING = {("actuator", "motor"): ("joint",)} | {
    ("randomize", name): ("field",) for name in ("joint", "body", "camera")
}


def kind_of(element: dict[str, Any]) -> str:
    return class_name(element["name"]) if element["holds"] else "Element"


def class_of(holder: dict[str, Any], sections: list[dict[str, Any]]) -> Iterator[str]:
    name = holder["name"]
    yield from ["", "", f"class {class_name(name)}(Holder):", f'    """`<{name}>` of a scene."""']
    for section in sections:
        kind, inside = class_name(section["name"]), [e["name"] for e in section["elements"]]
        yield from ["", "    @property", f"    def {section['name']}(self) -> {kind}:"]
        yield f'        """The section `<{section["name"]}>`, for {", ".join(inside)}."""'
        yield f'        return self._section({kind}, "{section["name"]}")'
    for element in holder["elements"]:
        yield from method_of(element, name)


def method_of(element: dict[str, Any], holder: str) -> Iterator[str]:
    name, kind = element["name"], kind_of(element)
    leading = LEADING.get((holder, name), ())
    first = [
        a
        for a in element["attributes"]
        if (is_needed(a) or a["name"] in leading) and holder != "default"
    ]
    rest = [a for a in element["attributes"] if a not in first]
    yield from ["", f"    def {name}(", "        self,"]
    for place, a in enumerate(first):
        free = not any(is_needed(later) for later in first[place:])
        yield f"        {a['name']}: {optional(type_of(a)) + ' = None' if free else type_of(a)},"
    if rest:
        yield "        *,"
    yield from (f"        {a['name']}: {optional(type_of(a))} = None," for a in rest)
    yield from ["        **unknown: NoReturn,", f"    ) -> {kind}:"]
    does = "Sets attributes of" if holder == "tangere" else "Adds"
    yield from [f'        """{does} `<{name}>`.', "", "        Parameters", "        ----------"]
    yield from (f"        {a['name']}: {text_of(a)}" for a in [*first, *rest])
    once = ", once=True" if holder == "tangere" else ""
    yield from ['        """', f'        return self._add({kind}, "{name}", locals(){once})']


def is_needed(attribute: dict[str, Any]) -> bool:
    return bool(attribute["needed"] and not attribute["types"])


def type_of(attribute: dict[str, Any]) -> str:
    words = attribute["words"]
    if set(words) == {"false", "true"}:
        return "bool"
    return f"Literal[{', '.join(repr(word) for word in words)}]" if words else "Value"


def optional(kind: str) -> str:
    return kind if kind == "Value" else f"{kind} | None"


def text_of(attribute: dict[str, Any]) -> str:
    text, types = attribute["text"] or attribute["name"], attribute["types"]
    for words, place in SEE.items():
        text = text.replace(words, place)
    unit = f" [{attribute['unit']}]" if attribute["unit"] else ""
    of = f"{', '.join(types)}: " if types else ""
    usual = f"; {attribute['default']} if left out" if attribute["default"] else ""
    return f"{of}{text}{unit}{usual}{'; needed' if types and attribute['needed'] else ''}"


if __name__ == "__main__":
    main()
