"""The library's names: all there, imported when they are used, and the same for type checkers."""

import ast
import subprocess
import sys
from pathlib import Path

import pytest

import grabberd

PATH = {"PYTHONPATH": str(Path(grabberd.__file__).parents[1])}
STUB = Path(grabberd.__file__).with_suffix(".pyi")


@pytest.mark.parametrize("name", grabberd.__all__)
def test_every_name_is_there(name: str) -> None:
    assert getattr(grabberd, name) is not None
    assert name in dir(grabberd)


def test_an_unknown_name_is_refused() -> None:
    with pytest.raises(AttributeError, match="has no attribute 'measure'"):
        grabberd.measure  # type: ignore[attr-defined]  # noqa: B018


def test_type_checkers_read_the_same_names() -> None:
    body = ast.parse(STUB.read_text()).body
    imported = {alias.asname for one in body if isinstance(one, ast.ImportFrom) for alias in one.names}
    assert imported | {"__version__"} == set(grabberd.__all__)


def test_without_extensions_a_capture_is_the_instruments_own(monkeypatch: pytest.MonkeyPatch) -> None:
    for name in ("__all__", "Analysis", "Capture", "open"):
        assert getattr(grabberd, name)
        monkeypatch.delattr(grabberd, name)
    monkeypatch.setattr("grabberd.extension.extensions", tuple)
    assert "Analysis" not in [*dir(grabberd), *grabberd.__all__]
    with grabberd.open(grabberd.example("liner.grab")) as capture:
        assert type(capture).__module__ == "grabberd.library.capture"
        with pytest.raises(AttributeError, match="'Capture' object has no attribute 'analyse'"):
            capture.analyse()


def test_importing_it_imports_nothing_else() -> None:
    program = (
        "import sys, importlib; before = set(sys.modules); import grabberd; print(set(sys.modules) - before)"
    )
    done = subprocess.run(
        [sys.executable, "-S", "-c", program], capture_output=True, text=True, check=True, env=PATH
    )
    assert done.stdout.strip() == "{'grabberd'}"


def test_an_error_shows_its_hint(tmp_path: Path) -> None:
    with pytest.raises(grabberd.GrabberdError) as caught:
        grabberd.open(tmp_path / "none.grab")
    assert caught.value.__notes__ == [f"hint: {caught.value.hint}"]
