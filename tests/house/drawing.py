"""The drawing of the rooms in docs/architecture.md, made from the layers that import-linter holds."""

import ast
import re
import tomllib
from collections.abc import Iterator

from .source import ROOT, modules, tree

ARCHITECTURE = ROOT / "docs" / "architecture.md"
START, END = "<!-- rooms: made by `make house`; do not edit -->", "<!-- end of rooms -->"
WIDTH = 108


def layers() -> list[list[str]]:
    """The rooms, layer by layer from the top: a room imports from lower layers alone."""
    settings = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))
    contracts = settings["tool"]["importlinter"]["contracts"]
    found = next(one for one in contracts if one["type"] == "layers" and one["containers"] == ["grabberd"])
    return [[room.strip(" ()") for room in re.split(r"[|:]", layer)] for layer in found["layers"]]


def floors(room: str) -> list[str]:
    """The folders of a room."""
    start = f"grabberd.{room}."
    return sorted(
        name.removeprefix(start)
        for name, path in modules().items()
        if name.startswith(start) and path.stem == "__init__" and name.count(".") == 2
    )


def purpose(room: str) -> str:
    """The first sentence of a room's docstring."""
    text = ast.get_docstring(tree(modules()[f"grabberd.{room}"])) or ""
    first = text.split("\n\n")[0].replace("\n", " ")
    return first.split(". ")[0].rstrip(".")


def drawing() -> str:
    """The rooms as a table of layers; floors stand under their room."""
    rows = ["| layer | room | what it is for | floors |", "|---|---|---|---|"]
    for height, layer in enumerate(layers()):
        for room in layer:
            rows.append(f"| {height + 1} | `{room}` | {purpose(room)} | {' '.join(floors(room))} |")
    return "\n".join(rows)


def written() -> str:
    """docs/architecture.md with the drawing of this moment."""
    text = ARCHITECTURE.read_text(encoding="utf-8")
    before, rest = text.split(START)
    return f"{before}{START}\n\n{drawing()}\n\n{END}{rest.split(END)[1]}"


def threads() -> Iterator[tuple[str, str]]:
    """Name, as far as it is fixed, and module of every thread that the program starts."""
    for module, path in modules().items():
        for node in ast.walk(tree(path)):
            if isinstance(node, ast.Call) and _starts_thread(node):
                for keyword in node.keywords:
                    if keyword.arg in ("name", "thread_name_prefix"):
                        yield _fixed(keyword.value), module


def _starts_thread(call: ast.Call) -> bool:
    words = ast.unparse(call.func)
    return words.endswith(("Thread", "ThreadPoolExecutor")) or words == "super().__init__"


def _fixed(name: ast.expr) -> str:
    """The part of a name that does not depend on device or capture: "writer-" of f"writer-{id}"."""
    if isinstance(name, ast.JoinedStr):
        return "".join(str(part.value) for part in name.values if isinstance(part, ast.Constant))
    return str(name.value) if isinstance(name, ast.Constant) else ""
