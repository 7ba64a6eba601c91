"""The libraries of others are the bytes they came with, few of them, with licence and origin."""

import gzip
import hashlib
from pathlib import Path

VENDOR = Path(__file__).parents[3] / "src" / "grabberd" / "server" / "web" / "static" / "vendor"
MOST_BYTES = 150_000
SHA_256 = {
    "ogl/LICENSE.txt": "6b0382b16279f26ff69014300541967a356a666eb0b91b422f6862f6b7dad17e",
    "ogl/ogl.js": "52b23e02203ddbb215ed8f209fd43a4f2f965da1672344c9018355e4dcea7166",
    "uplot/LICENSE.txt": "8f989229699b4fe2f1a0432d0e9edc338a8a911e250e2d1b01ecd770a5f5b1bd",
    "uplot/uPlot.esm.js": "5dd9b3281aa64b461b42d9945f6adb2649d346502b12281a9ae0d46599a80eba",
    "uplot/uPlot.min.css": "df630c6a8d6f8eeaff264b50f73ce5b114f646ffd9a0bb74f049b0a00135fa04",
}


def files() -> dict[str, bytes]:
    found = (path for path in VENDOR.glob("*/**/*") if path.is_file())
    return {path.relative_to(VENDOR).as_posix(): path.read_bytes() for path in found}


def test_they_are_the_bytes_that_they_came_with() -> None:
    assert {name: hashlib.sha256(content).hexdigest() for name, content in files().items()} == SHA_256


def test_all_together_are_light() -> None:
    assert sum(len(gzip.compress(content, 9)) for content in files().values()) <= MOST_BYTES


def test_each_is_listed_with_its_version_licence_and_origin() -> None:
    table = (VENDOR / "README.md").read_text(encoding="utf-8")
    for folder in sorted(path.name for path in VENDOR.iterdir() if path.is_dir()):
        row = next(line for line in table.splitlines() if line.startswith(f"| `{folder}/`"))
        name, version, licence, origin = (cell.strip() for cell in row.split("|")[2:6])
        assert name
        assert version[0].isdigit()
        assert licence
        assert "npm package" in origin
        assert (VENDOR / folder / "LICENSE.txt").read_text(encoding="utf-8")


def test_none_asks_another_host_for_anything() -> None:
    calls = (b"fetch(", b"XMLHttpRequest", b"WebSocket(", b"import(", b"sendBeacon", b"url(")
    for name, content in files().items():
        if not name.endswith(".txt"):
            assert not [call for call in calls if call in content], name
