"""The page: one document that needs no script inside and no other host."""

import json
import re

import pytest

from grabberd.server.web import POLICY, Files, language_of, render

EDITION = Files().newest()
SCRIPT = re.compile(r"<script([^>]*)>(.*?)</script>", re.DOTALL)


def test_no_script_or_style_stands_in_the_page() -> None:
    page = render(EDITION, "en", {})
    inside = [(how, text) for how, text in SCRIPT.findall(page) if text.strip()]
    assert [how for how, _ in inside] == [' type="application/json" id="first"']
    assert "<style" not in page
    assert "style=" not in page
    assert "unsafe" not in POLICY
    assert "://" not in page + POLICY


def test_what_it_first_shows_stands_in_it_and_cannot_end_the_script() -> None:
    first = {"state": {"note": "</script><script>alert(1)</script> \u2028"}}
    [(_, text)] = [one for one in SCRIPT.findall(render(EDITION, "nb", first)) if one[1].strip()]
    assert json.loads(text)["state"] == first["state"]


def test_every_address_in_it_is_one_of_its_files() -> None:
    page = render(EDITION, "en", {})
    root = f"/static/{EDITION.version}/"
    addresses = re.findall(r'(?:src|href)="([^"]+)"', page)
    static = [one for one in addresses if one.startswith("/static/")]
    assert len(static) > 5
    assert [one for one in static if one.removeprefix(root) not in EDITION.files] == []
    assert set(addresses) - set(static) == {"/api/v1/docs"}


@pytest.mark.parametrize(
    ("accepted", "language"),
    [
        ("", "en"),
        ("nb-NO,nb;q=0.9,en;q=0.5", "nb"),
        ("no", "nb"),
        ("nn-NO", "nb"),
        ("de, nb;q=0.8", "nb"),
        ("fr", "en"),
        ("en-GB", "en"),
    ],
)
def test_the_first_language_with_texts_is_spoken(accepted: str, language: str) -> None:
    assert language_of(accepted) == language
