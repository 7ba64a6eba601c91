"""Pictures and animations on the disk are what was drawn, as many, as large and as fast."""

import cv2
import numpy as np
import pytest

from archive.damage import damage, every_way
from grabberd.archive.export.pictures import Drawn, write_animation, write_pictures
from grabberd.errors import InputError, StorageError


def moving(count, size=(96, 128)):
    for n in range(count):
        picture = np.full((*size, 3), 255, np.uint8)
        cv2.circle(picture, (20 + 8 * n, 48), 12, (0, 0, 200), -1)
        yield picture


def test_pictures_come_back_from_png_as_they_were_transparency_too(tmp_path):
    random = np.random.default_rng(1)
    pictures = {
        name: random.integers(0, 256, shape, np.uint8)
        for name, shape in (("grey", (20, 30)), ("colour", (20, 30, 3)), ("see-through", (20, 30, 4)))
    }
    for path in write_pictures(tmp_path / "out", pictures):
        assert (cv2.imread(str(path), cv2.IMREAD_UNCHANGED) == pictures[path.stem]).all()


def test_a_webm_is_vp9_with_every_picture_at_its_pace(tmp_path, capfd):
    path = write_animation(tmp_path / "out", "model.webm", moving(10), 12.5)
    video = cv2.VideoCapture(str(path))
    assert path.read_bytes()[:4] == b"\x1a\x45\xdf\xa3"
    assert b"V_VP9" in path.read_bytes()
    assert video.get(cv2.CAP_PROP_FPS) == pytest.approx(12.5, rel=0.01)
    shown = []
    while (read := video.read())[0]:
        shown.append(read[1])
    assert len(shown) == 10
    for found, drawn in zip(shown, moving(10), strict=True):
        assert found.shape == drawn.shape
        assert np.abs(found.astype(int) - drawn).mean() < 4
    assert capfd.readouterr().err == ""


def test_a_gif_has_every_picture_at_its_pace(tmp_path):
    path = write_animation(tmp_path / "out", "model.gif", moving(6), 10)
    good, animation = cv2.imreadanimation(str(path))
    assert good
    assert len(animation.frames) == 6
    assert list(animation.durations) == [100] * 6
    for found, drawn in zip(animation.frames, moving(6), strict=True):
        assert np.abs(found[:, :, :3].astype(int) - drawn).mean() < 6


@pytest.mark.parametrize("name", ["model.webm", "model.gif"])
def test_an_animation_of_nothing_is_refused(tmp_path, name):
    with pytest.raises(InputError, match="no pictures"):
        write_animation(tmp_path / "out", name, [], 10)


def test_a_gif_of_very_many_pictures_is_refused(tmp_path):
    small = np.zeros((2, 2, 3), np.uint8)
    with pytest.raises(InputError, match="at most 500"):
        write_animation(tmp_path / "out", "model.gif", (small for _ in range(600)), 10)


def test_nothing_is_overwritten(tmp_path):
    (tmp_path / "mine").write_text("mine")
    with pytest.raises(StorageError, match="not empty"):
        write_pictures(tmp_path, {"grey": np.zeros((2, 2), np.uint8)})
    with pytest.raises(StorageError, match="not empty"):
        write_animation(tmp_path, "model.webm", moving(2), 10)


@every_way
@pytest.mark.parametrize("name", ["model.webm", "model.gif"])
def test_an_animation_damaged_before_it_is_read_back_gets_no_name(tmp_path, monkeypatch, spoil, name, capfd):
    damage(monkeypatch, spoil)
    with pytest.raises(StorageError, match=f"{name} reads back other than it was written"):
        write_animation(tmp_path / "out", name, moving(10), 12.5)
    assert list((tmp_path / "out").iterdir()) == []
    assert capfd.readouterr().err == ""


@pytest.mark.parametrize("name", ["model.webm", "model.gif"])
@pytest.mark.parametrize(
    ("other", "said"),
    [
        ([*moving(9)], "it has 9 pictures, expected 10"),
        ([*moving(11)], "it has more than 10 pictures"),
        ([*moving(10, (120, 160))], "picture 1 has 160 × 120 pixels"),
        ([*moving(10)][::-1], "picture 1 is another one"),
    ],
)
def test_an_animation_of_other_pictures_is_told_from_what_was_drawn(tmp_path, name, other, said):
    drawn = Drawn()
    list(drawn.noted(moving(10)))
    assert drawn.check(write_animation(tmp_path, name, other, 10)) == said
