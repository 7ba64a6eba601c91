"""Imports are read from the text of a small repository; nothing of it is run."""

from pathlib import Path

import pytest
from tests.affected.imports import Imports

FILES = {
    "src/grabberd/__init__.py": "",
    "src/grabberd/core/geometry/__init__.py": (
        "from grabberd.core.geometry.view import View\nfrom .rig import Rig as R"
    ),
    "src/grabberd/core/geometry/view.py": "import numpy",
    "src/grabberd/core/geometry/rig.py": "from .view import View",
    "src/grabberd/late.py": "def f():\n    from grabberd.core.geometry import rig",
    "src/grabberd/whole.py": "import grabberd.core.geometry",
    "src/grabberd/chosen.py": "import importlib\nimportlib.import_module(f'grabberd.core.geometry.{name}')",
    "tests/support/running.py": "from grabberd.core.geometry import R",
    "tests/server/daemon/test_it.py": "from running import live",
    "tests/proofs/faults/playing.py": "",
    "tests/proofs/faults/test_faults.py": "from .playing import play",
}


@pytest.fixture
def imports(tmp_path: Path) -> Imports:
    for name, text in FILES.items():
        (tmp_path / name).parent.mkdir(parents=True, exist_ok=True)
        (tmp_path / name).write_text(text)
    return Imports(tmp_path)


@pytest.mark.parametrize(
    ("importer", "used"),
    [
        ("tests/support/running.py", ["src/grabberd/core/geometry/rig.py"]),
        ("src/grabberd/core/geometry/rig.py", ["src/grabberd/core/geometry/view.py"]),
        ("src/grabberd/core/geometry/view.py", []),
        ("src/grabberd/late.py", ["src/grabberd/core/geometry/rig.py"]),
        ("src/grabberd/whole.py", ["src/grabberd/core/geometry/__init__.py"]),
        (
            "src/grabberd/chosen.py",
            ["src/grabberd/core/geometry/rig.py", "src/grabberd/core/geometry/view.py"],
        ),
        ("tests/server/daemon/test_it.py", ["tests/support/running.py"]),
        ("tests/proofs/faults/test_faults.py", ["tests/proofs/faults/playing.py"]),
    ],
)
def test_a_name_leads_to_the_file_that_defines_it(imports: Imports, importer: str, used: list[str]) -> None:
    assert imports.used[Path(importer)] == {Path(path) for path in used}


def test_a_package_knows_who_takes_names_through_it(imports: Imports) -> None:
    package = Path("src/grabberd/core/geometry/__init__.py")
    assert Path("tests/support/running.py") in imports.through[package]
