"""The API's own page."""

import base64
import hashlib
import re
from html.parser import HTMLParser

import pytest
from fastapi.testclient import TestClient

from grabberd.server.api.openapi import type_in_words

VOID = {"meta", "br"}


class Reader(HTMLParser):
    """Gathers what a page has, and whether its elements are closed in order."""

    def __init__(self, text: str) -> None:
        super().__init__()
        self.open: list[str] = []
        self.names: set[str] = set()
        self.links: list[str] = []
        self.elements: set[str] = set()
        self.feed(text)
        self.close()

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        self.elements.add(tag)
        attributes = dict(attrs)
        if name := attributes.get("id"):
            assert name not in self.names
            self.names.add(name)
        if tag == "a":
            self.links.append(attributes["href"] or "")
        if tag not in VOID:
            self.open.append(tag)

    def handle_endtag(self, tag: str) -> None:
        assert self.open.pop() == tag


@pytest.fixture(scope="module")
def text(idle: TestClient) -> str:
    answer = idle.get("/api/v1/docs")
    assert answer.status_code == 200
    assert answer.headers["content-type"].startswith("text/html")
    return answer.text


def test_every_route_stands_on_it(idle: TestClient, text: str) -> None:
    names = Reader(text).names
    for path, methods in idle.get("/api/v1/openapi.json").json()["paths"].items():
        assert f"<code>{path}</code>" in text
        assert {operation["operationId"] for operation in methods.values()} <= names
    assert "/api/v1/preview?device=NAME" in text


def test_it_needs_nothing_but_itself(text: str) -> None:
    page = Reader(text)
    assert page.elements & {"script", "link", "img", "iframe", "object", "form"} == set()
    assert re.findall(r"https?://|//[a-z]|url\(|@import", text) == []


def test_every_link_leads_somewhere_and_every_element_is_closed(text: str) -> None:
    page = Reader(text)
    assert page.open == []
    inner = {link.removeprefix("#") for link in page.links if link.startswith("#")}
    assert inner <= page.names
    assert [link for link in page.links if not link.startswith("#")] == ["/api/v1/openapi.json"]


def test_its_policy_allows_its_own_style_and_nothing_else(idle: TestClient, text: str) -> None:
    policy = idle.get("/api/v1/docs").headers["content-security-policy"]
    style = re.search(r"<style>(.*?)</style>", text, re.DOTALL)
    assert style is not None
    digest = base64.b64encode(hashlib.sha256(style[1].encode()).digest()).decode()
    assert policy.startswith(f"default-src 'none'; style-src 'sha256-{digest}'")
    assert "style=" not in text


@pytest.mark.parametrize(
    ("schema", "words"),
    [
        ({"type": "integer", "minimum": 1, "maximum": 9}, "integer, ≥ 1, ≤ 9"),
        ({"$ref": "#/components/schemas/Role"}, '<a href="#Role">Role</a>'),
        ({"anyOf": [{"type": "string"}, {"type": "null"}]}, "string or null"),
        ({"type": "array", "items": {"type": "number"}}, "list of number"),
        ({"type": "object", "additionalProperties": {"type": "string"}}, "object of string"),
        ({"enum": ["a", "<b>"]}, "<code>&quot;a&quot;</code> or <code>&quot;&lt;b&gt;&quot;</code>"),
        ({"const": 1}, "<code>1</code>"),
        ({"type": "string", "pattern": "^<"}, "string, like ^&lt;"),
        ({}, "anything"),
    ],
)
def test_a_type_in_words(schema: dict[str, object], words: str) -> None:
    assert type_in_words(schema) == words
