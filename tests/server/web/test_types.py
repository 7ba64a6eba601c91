"""The page's types: in one place, never served, and none of them waved through."""

import json
import re
from pathlib import Path

from grabberd.server.web import Files
from grabberd.server.web.page import STATIC

ROOT = Path(__file__).parents[3]
TYPES = STATIC.parent / "types"
MODULES = sorted((STATIC / "js").rglob("*.js"))
UNCHECKED = re.compile(r"@ts-(?:ignore|nocheck|expect-error)|\{[^}]*\bany\b[^}]*\}")


def comments(path: Path) -> str:
    return "\n".join(re.findall(r"/\*.*?\*/", path.read_text(), re.DOTALL))


def test_no_type_is_served() -> None:
    assert [name for name in Files().newest().files if name.endswith((".ts", ".map"))] == []


def test_no_module_waves_a_type_through() -> None:
    assert {path.name: found for path in MODULES if (found := UNCHECKED.findall(comments(path)))} == {}


def test_modules_know_documents_by_the_page_s_own_names() -> None:
    assert [path.name for path in MODULES if "types/openapi" in path.read_text()] == []


def test_every_file_of_types_is_used() -> None:
    imported = set(re.findall(r'from "(?:types|\.)/(\w+)(?:\.d\.ts)?"', "\n".join(read())))
    assert {path.name.removesuffix(".d.ts") for path in TYPES.glob("*.d.ts")} - imported == {"vendor"}


def test_libraries_are_checked_against_the_types_of_the_version_that_is_served() -> None:
    pinned = json.loads((ROOT / "package.json").read_text())["devDependencies"]
    vendored = re.findall(
        r"^\| `(\w+)/` \|[^|]*\| ([\d.]+) \|", (STATIC / "vendor" / "README.md").read_text(), re.M
    )
    assert dict(vendored)
    assert {name: pinned.get(name) for name, _ in vendored} == dict(vendored)


def test_the_tools_are_pinned_and_come_from_any_registry() -> None:
    pinned = json.loads((ROOT / "package.json").read_text())["devDependencies"]
    assert [name for name, version in pinned.items() if not re.fullmatch(r"[\d.]+", version)] == []
    assert "resolved" not in (ROOT / "package-lock.json").read_text()


def read() -> list[str]:
    return [path.read_text() for path in (*MODULES, *TYPES.glob("*.d.ts"))]
