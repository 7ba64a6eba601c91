"""Sizes of the source: files and lines by room, overlong files, repeated names, import cycles."""

from collections import Counter
from collections.abc import Mapping

from .source import LINER, ROOT, imports, modules, relative

LONGEST = 500
"""Lines of the longest file that a reader still takes in as one thing."""


def lines() -> dict[str, int]:
    """Lines of every file of the program and its drivers."""
    return {relative(path): len(path.read_text(encoding="utf-8").splitlines()) for path in modules().values()}


def too_long() -> dict[str, int]:
    """Files over the limit."""
    return {file: count for file, count in lines().items() if count > LONGEST}


def rooms() -> dict[str, tuple[int, int]]:
    """Files and lines of every room; a driver is a room, and so are those of the core and of the liner."""
    files, total = Counter[str](), Counter[str]()
    for file, count in lines().items():
        folders = file.split("/")[:-1]
        room = "/".join(folders[: 2 if folders[:1] in (["core"], [LINER]) else 1]) or "."
        files[room] += 1
        total[room] += count
    return {room: (files[room], total[room]) for room in sorted(files)}


def same_names() -> dict[str, int]:
    """File names that occur more than once, `__init__` apart."""
    stems = Counter(path.stem for path in modules().values())
    return {stem: count for stem, count in sorted(stems.items()) if count > 1 and not stem.startswith("__")}


def cycles() -> list[list[str]]:
    """Modules that import one another in a circle, also by imports for types alone or inside functions.

    A package's `__init__` only re-exports: what imports a name from it depends on the module that defines it,
    so `__init__` files are left out.
    """
    paths = {name: path for name, path in modules().items() if path.stem != "__init__"}
    graph = {name: {one for one in imports(name, path) if one in paths} for name, path in paths.items()}
    return [sorted(group) for group in _components(graph) if len(group) > 1]


def _components(graph: Mapping[str, set[str]]) -> list[list[str]]:
    """Strongly connected components, by Tarjan's algorithm."""
    index: dict[str, int] = {}
    low: dict[str, int] = {}
    stack: list[str] = []
    found: list[list[str]] = []

    def visit(node: str) -> None:
        index[node] = low[node] = len(index)
        stack.append(node)
        for other in sorted(graph[node]):
            if other not in index:
                visit(other)
                low[node] = min(low[node], low[other])
            elif other in stack:
                low[node] = min(low[node], index[other])
        if low[node] == index[node]:
            start = stack.index(node)
            found.append(stack[start:])
            del stack[start:]

    for node in sorted(graph):
        if node not in index:
            visit(node)
    return found


def table() -> str:
    """Markdown: the rooms, and the sums."""
    rows = [f"| {room} | {files} | {count} |" for room, (files, count) in rooms().items()]
    own = [
        count
        for file, count in lines().items()
        if not file.startswith("grabberd_") or file.startswith(f"{LINER}/")
    ]
    rows.append(f"| src in all | {len(own)} | {sum(own)} |")
    return "\n".join(["| room | files | lines |", "|---|---|---|", *rows])


if __name__ == "__main__":
    print(ROOT.name, table(), same_names(), cycles(), too_long(), sep="\n")
