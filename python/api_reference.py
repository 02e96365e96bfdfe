# SPDX-License-Identifier: Apache-2.0
"""Writes docs/python_api.md from the docstrings of the package.

    PYTHONPATH=build/release/python python python/api_reference.py

Sources and stub are parsed, not imported, so that no package is needed for it. A test compares the
page with what this makes, and finds public names without a docstring.
"""

from __future__ import annotations

import ast
import importlib.util
import inspect
import re
import sys
from pathlib import Path
from typing import Iterator

PAGE = Path(__file__).parents[1] / "docs/python_api.md"
WIDTH = 100
# In the order of the page; the compiled part is shown as tangere, from where it is used.
MODULES = (
    "tangere", "scene_builder", "robots", "gym", "scene_env", "torch", "jax", "data", "export",
    "policy", "lerobot", "robomimic", "sb3", "d3rlpy", "ray", "store", "gel",
)  # fmt: skip
HEAD = """# Python: every name

This page has every public class and function of the package with its docstring. [Python](python.md)
shows how to use them. The page is made from the sources:

    PYTHONPATH=build/release/python build/venv/bin/python python/api_reference.py

(E: environments; na: numbers of an action; KEY: an observation's name; … : its shape)
"""

Node = ast.FunctionDef | ast.ClassDef


def public(name: str) -> bool:
    return not name.startswith("_") or name == "__version__"


def parse(path: Path) -> ast.Module:
    return ast.parse(path.read_text(encoding="utf-8"))


def names_of(module: ast.Module) -> list[str] | None:
    """What __all__ lists."""
    for node in module.body:
        if isinstance(node, ast.Assign) and ast.unparse(node.targets[0]) == "__all__":
            return list(ast.literal_eval(node.value))
    return None


def nodes_of(package: Path, module: str) -> Iterator[tuple[str, Node]]:
    """The public classes and functions of a module, and where each is written."""
    if module != "tangere":
        tree = parse(package / f"{module}.py")
        listed = names_of(tree)
        own = {node.name: node for node in tree.body if isinstance(node, Node)}
        for part in tree.body if listed else []:  # what is written in a private module
            path = package / f"{getattr(part, 'module', None)}.py"
            if isinstance(part, ast.ImportFrom) and part.level == 1 and path.name.startswith("_"):
                if path.exists():
                    own = {n.name: n for n in parse(path).body if isinstance(n, Node)} | own
        for name in listed or [name for name in own if public(name)]:
            yield name, own[name]
        return
    tree = parse(package / "__init__.py")
    found: dict[str, Node] = {}
    for part in ("_core.pyi", "_rollout.py", "_view.py", "__init__.py"):
        found |= {n.name: n for n in parse(package / part).body if isinstance(n, Node)}
    for name in names_of(tree) or []:
        if name in found:  # those of tangere.gym are there
            yield name, found[name]


def signature(node: ast.FunctionDef, owner: str, prefix: str) -> list[str]:
    """Lines of code: `prefix.name(a, b) -> c`, wrapped at commas."""
    arguments = ast.parse(ast.unparse(node)).body[0].args  # type: ignore[attr-defined]
    static = any(ast.unparse(d) == "staticmethod" for d in node.decorator_list)
    bound = owner and not static
    plain = arguments.posonlyargs or arguments.args
    if bound and plain:
        plain.pop(0)
    words = [word.strip() for word in split_at_commas(ast.unparse(arguments))]
    name = owner if node.name == "__init__" else f"{owner}.{node.name}" if owner else node.name
    ends = "" if node.returns is None or node.name == "__init__" else ast.unparse(node.returns)
    ends = f") -> {ends}" if ends else ")"
    one = f"{prefix}{name}({', '.join(words)}{ends}"
    if len(one) <= WIDTH - 4:
        return [one]
    lines = [f"{prefix}{name}(", *lines_of(words), ends] if words else [f"{prefix}{name}({ends}"]
    if len(lines[-1]) > WIDTH:  # a long tuple
        start, _, parts = lines.pop().partition("[")
        lines += [f"{start}[", *lines_of(split_at_commas(parts[:-1])), "]"]
    return lines


def lines_of(words: list[str]) -> list[str]:
    """Indented lines of words, a comma between two."""
    lines, line = [], "   "
    for word in words:
        if len(line) + len(word) + 2 > WIDTH - 4:
            lines.append(line)
            line = "   "
        line += f" {word.strip()},"
    return [*lines, line.rstrip(",")]


def split_at_commas(text: str) -> list[str]:
    words, depth, word = [], 0, ""
    for c in text:
        depth += (c in "([{") - (c in ")]}")
        if c == "," and depth == 0:
            words.append(word)
            word = ""
        else:
            word += c
    return [*words, word] if word.strip() else words


def text_of(doc: str, indent: str = "") -> list[str]:
    """A docstring as Markdown: the list of parameters as a list."""
    lines = inspect.cleandoc(doc).splitlines()
    shown, in_list = [], False
    for number, line in enumerate(lines):
        if re.fullmatch(r"-+", line):
            continue
        if line == "Parameters" and lines[number + 1].startswith("---"):
            shown += ["Parameters:", ""]
            in_list = True
            continue
        if in_list and line and not line.startswith(" "):
            name, colon, rest = line.partition(":")
            names = ", ".join(f"`{n.strip()}`" for n in name.split(","))
            if not colon or not re.fullmatch(r"[\w, ]+", name):
                in_list = False
                shown.append(line)
            else:
                shown.append(f"- {names}:{rest}")
        elif in_list and line:
            shown.append(f"  {line.strip()}")
        else:
            in_list = in_list and not (not line and is_text_after(lines, number))
            shown.append(line)
    return [re.sub(r"(?<!`)<(?=\w)", r"\\<", f"{indent}{line}".rstrip()) for line in shown]


def is_text_after(lines: list[str], number: int) -> bool:
    """Whether a paragraph follows, not another parameter."""
    rest = next((line for line in lines[number + 1 :] if line), "")
    return not re.match(r"\w[\w, ]*:", rest)


def code(lines: list[str]) -> list[str]:
    return ["```python", *lines, "```", ""]


def members_of(package: Path, node: ast.ClassDef) -> list[ast.FunctionDef]:
    """The functions of a class, and those that it takes over from private modules."""
    own = [n for n in node.body if isinstance(n, ast.FunctionDef)]
    names = {base.id for base in node.bases if isinstance(base, ast.Name)}
    for path in sorted(package.glob("_*.py")) if names else []:
        for other in parse(path).body:
            if isinstance(other, ast.ClassDef) and other.name in names:
                known = {n.name for n in own}
                more = [n for n in members_of(package, other) if n.name not in known]
                own += [n for n in more if n.name != "__init__" or ast.get_docstring(n)]
    return own


def page(package: Path) -> tuple[str, list[str]]:
    """The text of the page, and public names without a docstring."""
    shown, silent = [HEAD], []

    def describe(name: str, node: ast.FunctionDef | ast.ClassDef) -> None:
        doc = ast.get_docstring(node)
        if doc:
            shown.extend([*text_of(doc), ""])
        else:
            silent.append(name)

    for module in MODULES:
        prefix = "tangere." if module == "tangere" else f"tangere.{module}."
        shown += [f"## {prefix[:-1]}", ""]
        if module != "tangere":
            first = ast.get_docstring(parse(package / f"{module}.py")) or ""
            shown += [first.splitlines()[0], ""]
        for name, node in nodes_of(package, module):
            shown += [f"### {prefix}{name}", ""]
            if isinstance(node, ast.FunctionDef):
                shown += code(signature(node, "", prefix))
                describe(prefix + name, node)
                continue
            members = members_of(package, node)
            made = next((n for n in members if n.name == "__init__"), None)
            if made:
                shown += code(signature(made, name, prefix))
            bases = ", ".join(ast.unparse(base) for base in node.bases)
            if name in ("InputError", "IoError"):
                shown += [f"A `{bases}`; see [Python](python.md).", ""]
            else:
                describe(prefix + name, node)
            doc = made and ast.get_docstring(made)
            if doc:
                shown += [*text_of(doc), ""]
            properties, methods = [], []
            for member in members:
                if not public(member.name):
                    continue
                decorators = [ast.unparse(d) for d in member.decorator_list]
                if any(d.endswith(".setter") for d in decorators):
                    continue
                (properties if "property" in decorators else methods).append(member)
            for field in node.body:
                if isinstance(field, ast.AnnAssign) and public(ast.unparse(field.target)):
                    kind = ast.unparse(field.annotation)
                    shown.append(f"- `{ast.unparse(field.target)}`: {kind}")
            if any(base.endswith("Enum") for base in bases.split(", ")):
                shown += [*values(node), ""]
            for member in properties:
                kind = ast.unparse(member.returns) if member.returns else ""
                doc = " ".join((ast.get_docstring(member) or "").split())
                of_kind = f"`{kind}`. " if kind else ""
                shown += wrapped(f"- `{member.name}`: {of_kind}{doc}".rstrip())
            if properties or any(isinstance(f, ast.AnnAssign) for f in node.body):
                shown.append("")
            for member in methods:
                shown += code(signature(member, name, ""))
                describe(f"{prefix}{name}.{member.name}", member)
    text = "\n".join(shown)
    return re.sub(r"\n{3,}", "\n\n", text).rstrip() + "\n", silent


def values(enumeration: ast.ClassDef) -> list[str]:
    """Its values, each with the text that follows it."""
    lines = []
    for field, after in zip(enumeration.body, [*enumeration.body[1:], None]):
        if not isinstance(field, ast.Assign):
            continue
        doc = " ".join(after.value.value.split()) if isinstance(after, ast.Expr) else ""
        lines += wrapped(f"- `{ast.unparse(field)}` {doc}".rstrip())
    return lines


def wrapped(text: str) -> list[str]:
    lines, line = [], ""
    for word in text.split(" "):
        if line and len(line) + 1 + len(word) > WIDTH:
            lines.append(line)
            line = "  " + word
        else:
            line = f"{line} {word}" if line else word
    return [*lines, line]


def main() -> int:
    sys.path.pop(0)  # this folder, whose package has no compiled part
    found = importlib.util.find_spec("tangere")
    if found is None or not found.submodule_search_locations:
        print("api_reference: no package tangere; set PYTHONPATH", file=sys.stderr)
        return 2
    text, silent = page(Path(found.submodule_search_locations[0]))
    for name in silent:
        print(f"api_reference: {name} has no docstring", file=sys.stderr)
    if silent:
        return 1
    PAGE.write_text(text, encoding="utf-8")
    print(f"wrote {PAGE}: {len(text.splitlines())} lines")
    return 0


if __name__ == "__main__":
    sys.exit(main())
