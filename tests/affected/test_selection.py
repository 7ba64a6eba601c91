"""The nearest tests run, and no longer than they may."""

from pathlib import Path

import pytest
from tests.affected.imports import Imports
from tests.affected.selection import Selection, select

FILES = {
    "src/grabberd/core/geometry/__init__.py": "from grabberd.core.geometry.view import View",
    "src/grabberd/core/geometry/view.py": "",
    "src/grabberd_liner/analysis/wall.py": "from grabberd.core.geometry import View",
    "src/grabberd/server/daemon/service.py": "from grabberd_liner.analysis.wall import Wall",
    "drivers/grabberd_fake/world.py": "",
    "tests/conftest.py": "",
    "tests/core/geometry/test_rotation.py": "",
    "tests/liner/analysis/shapes.py": "from grabberd.core.geometry import View",
    "tests/liner/analysis/test_shapes.py": "from liner.analysis.shapes import round",
    "tests/liner/analysis/test_wall.py": "from grabberd_liner.analysis.wall import Wall",
    "tests/server/daemon/conftest.py": "from grabberd.server.daemon.service import Service",
    "tests/server/daemon/test_service.py": "",
    "tests/drivers/fake/test_world.py": "",
    "tests/contract/test_driver_contract.py": "",
    "tests/server/web/modules/test_modules.py": "",
    "tests/proofs/vm/test_usb.py": "from grabberd.core.geometry.view import View",
}
VIEW = "src/grabberd/core/geometry/view.py"
NEAREST_FIRST = [
    "tests/core/geometry/test_rotation.py",
    "tests/liner/analysis/test_shapes.py",
    "tests/liner/analysis/test_wall.py",
    "tests/server/daemon/test_service.py",
]


@pytest.fixture
def imports(tmp_path: Path) -> Imports:
    for name, text in FILES.items():
        (tmp_path / name).parent.mkdir(parents=True, exist_ok=True)
        (tmp_path / name).write_text(text)
    return Imports(tmp_path)


def selected(
    imports: Imports, *changes: str, limit_s: float = 1e3, took_s: dict[str, float] | None = None
) -> Selection:
    return select([Path(change) for change in changes], imports, took_s or {}, limit_s)


def names(paths: tuple[Path, ...]) -> list[str]:
    return [path.as_posix() for path in paths]


def test_the_changed_files_room_comes_first_then_whoever_is_fewest_imports_away(imports: Imports) -> None:
    assert names(selected(imports, VIEW).near) == NEAREST_FIRST


def test_what_there_is_no_time_for_is_named(imports: Imports) -> None:
    took_s = dict.fromkeys(NEAREST_FIRST, 2.0) | {NEAREST_FIRST[1]: 50.0}
    selection = selected(imports, VIEW, limit_s=4.5, took_s=took_s)
    assert names(selection.near) == [NEAREST_FIRST[0], NEAREST_FIRST[2]]
    assert names(selection.left_out) == [NEAREST_FIRST[1], NEAREST_FIRST[3]]


def test_with_time_enough_nothing_that_is_reached_is_left_out(imports: Imports) -> None:
    assert selected(imports, VIEW).left_out == ()


def test_a_changed_test_runs_whatever_it_takes(imports: Imports) -> None:
    selection = selected(imports, "tests/liner/analysis/test_wall.py", limit_s=0.0)
    assert names(selection.changed) == ["tests/liner/analysis/test_wall.py"]
    assert selection.near == ()


@pytest.mark.parametrize(
    ("change", "near"),
    [
        ("tests/liner/analysis/shapes.py", ["tests/liner/analysis/test_shapes.py"]),
        ("tests/server/daemon/conftest.py", ["tests/server/daemon/test_service.py"]),
        ("src/grabberd/core/geometry/__init__.py", NEAREST_FIRST),
        ("src/grabberd/server/web/static/js/main.js", ["tests/server/web/modules/test_modules.py"]),
        (
            "drivers/grabberd_fake/world.py",
            ["tests/contract/test_driver_contract.py", "tests/drivers/fake/test_world.py"],
        ),
        ("src/grabberd/core/geometry/deleted.py", ["tests/core/geometry/test_rotation.py"]),
        (
            "src/grabberd_liner/analysis/deleted.py",
            ["tests/liner/analysis/test_shapes.py", "tests/liner/analysis/test_wall.py"],
        ),
    ],
)
def test_helpers_facades_and_files_that_nobody_imports_have_tests_too(
    imports: Imports, change: str, near: list[str]
) -> None:
    assert names(selected(imports, change).near) == near


def test_a_file_that_no_test_is_known_for_is_named(imports: Imports) -> None:
    assert names(selected(imports, "LICENSE").unknown) == ["LICENSE"]


def test_what_every_test_depends_on_concerns_the_whole_suite(imports: Imports) -> None:
    assert selected(imports, "pyproject.toml").whole
    assert not selected(imports, VIEW).whole
