"""The drawing of the rooms in docs/architecture.md, made from the layers that import-linter holds."""

import ast
import re
import tomllib
from collections.abc import Iterator

from .source import LINER, ROOT, modules, tree

ARCHITECTURE = ROOT / "docs" / "architecture.md"
START, END = "<!-- rooms: made by `make house`; do not edit -->", "<!-- end of rooms -->"
INSTRUMENT, CORE = "grabberd", "grabberd.core"


def layers(house: str = INSTRUMENT) -> list[list[str]]:
    """A house's rooms, layer by layer from the top: a room imports from lower layers alone."""
    settings = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))
    contracts = settings["tool"]["importlinter"]["contracts"]
    found = next(one for one in contracts if one["type"] == "layers" and one["containers"] == [house])
    return [[room.strip(" ()") for room in re.split(r"[|:]", layer)] for layer in found["layers"]]


def floors(house: str, room: str = "") -> list[str]:
    """The folders of a room, or of a house."""
    start = f"{house}.{room}." if room else f"{house}."
    return sorted(
        name.removeprefix(start)
        for name, path in modules().items()
        if name.startswith(start) and path.stem == "__init__" and name.count(".") == start.count(".")
    )


def purpose(house: str, room: str) -> str:
    """The first sentence of a room's docstring."""
    text = ast.get_docstring(tree(modules()[f"{house}.{room}"])) or ""
    first = text.split("\n\n")[0].replace("\n", " ")
    return first.split(". ")[0].rstrip(".")


def drawing() -> str:
    """The rooms of every house as a table; floors stand under their room."""
    tables = (
        ("The instrument, `grabberd`:", _layered(INSTRUMENT)),
        ("The core, `grabberd.core`:", _layered(CORE)),
        (f"The liner science, `{LINER}`:", _listed(LINER)),
    )
    return "\n\n".join(f"{title}\n\n{table}" for title, table in tables)


def _layered(house: str) -> str:
    rows = ["| layer | room | what it is for | floors |", "|---|---|---|---|"]
    for height, layer in enumerate(layers(house)):
        for room in layer:
            rows.append(f"| {height + 1} | {_described(house, room)} |")
    return "\n".join(rows)


def _listed(house: str) -> str:
    rows = [f"| {_described(house, room)} |" for room in floors(house)]
    return "\n".join(["| room | what it is for | floors |", "|---|---|---|", *rows])


def _described(house: str, room: str) -> str:
    return f"`{room}` | {purpose(house, room)} | {' '.join(floors(house, room))}"


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
