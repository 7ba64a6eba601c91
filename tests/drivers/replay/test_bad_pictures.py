"""A bad picture amid a folder ends the capture with the file's name; what came before it is kept."""

from pathlib import Path

import numpy as np
import pytest
from typer.testing import CliRunner

from drivers.replay.pictures import COLUMNS, frames, luma, png
from grabberd.archive.capture.reader import CaptureReader
from grabberd.cli.app import app
from grabberd.core.field import unpack
from grabberd.errors import PictureError

GOOD, LINES = 3, 288


def transparent(path: Path) -> None:
    picture = np.repeat(luma(1, LINES)[..., None], 4, axis=2)
    picture[..., 3] = 128
    path.write_bytes(png(picture))


SPOILT = {
    "of another size": (
        lambda path: path.write_bytes(png(luma(1, 240))),
        "is 720x240 grey, expected 720x288",
    ),
    "truncated": (lambda path: path.write_bytes(path.read_bytes()[:1000]), "truncated after 1000 bytes"),
    "empty": (lambda path: path.write_bytes(b""), "truncated in its head"),
    "no picture": (lambda path: path.write_text("notes" * 20), "is no PNG"),
    "of 16 bits": (
        lambda path: path.write_bytes(png(luma(1, LINES).astype(np.uint16) * 256)),
        "is 720x288 grey of 16 bits, expected 720x288 grey",
    ),
    "coloured": (
        lambda path: path.write_bytes(png(np.repeat(luma(1, LINES)[..., None], 3, axis=2))),
        "is 720x288 coloured, expected 720x288 grey",
    ),
    "transparent": (transparent, "coloured, expected 720x288 grey"),
    "away while it is played": (lambda path: (path.unlink(), path.symlink_to("nowhere")), "is missing"),
}


@pytest.mark.parametrize("how", SPOILT)
def test_the_picture_is_named_and_the_fields_before_it_are_sealed(tmp_path: Path, how: str) -> None:
    spoil, said = SPOILT[how]
    folder, out = frames(tmp_path / "pictures", 2 * GOOD, LINES), tmp_path / "x.grab"
    spoil(folder / f"frame-{GOOD:04d}.png")
    words = ["capture", "--device", f"replay:{folder}", "--fields", "6", "--bits", "8", "--out", str(out)]
    result = CliRunner().invoke(app, words)
    assert isinstance(result.exception, PictureError)
    assert f"frame-{GOOD:04d}.png" in result.exception.message
    assert said in result.exception.message
    assert result.exception.hint
    with CaptureReader(out) as reader:
        assert (reader.meta.state, reader.meta.complete) == ("sealed", False)
        assert f"frame-{GOOD:04d}.png" in reader.meta.ended_because
        kept = list(reader.received())
    assert len(kept) == GOOD
    for number, one in enumerate(kept):
        np.testing.assert_array_equal(unpack(one.packed).luma, luma(number, LINES, COLUMNS))


def test_a_folder_of_transparent_pictures_is_refused_by_its_first(tmp_path: Path) -> None:
    transparent(tmp_path / "one.png")
    words = ["capture", "--device", f"replay:{tmp_path}", "--fields", "6", "--out", str(tmp_path / "x.grab")]
    result = CliRunner().invoke(app, words)
    assert "one.png has an alpha channel" in str(result.exception)
    assert not (tmp_path / "x.grab").exists()
