from html.parser import HTMLParser

from hypothesis import given
from hypothesis import strategies as st

from grabberd.reports.markup import Html, element, facts, joined, table, text
from reports.pages import Page

READABLE = st.text(st.characters(exclude_categories=["Cs", "Cc"]))


class _Reader(HTMLParser):
    def __init__(self, markup):
        super().__init__()
        self.found, self.attributes = "", {}
        self.feed(markup)
        self.close()

    def handle_starttag(self, _tag, attrs):
        self.attributes |= dict(attrs)

    def handle_data(self, data):
        self.found += data


@given(READABLE, READABLE)
def test_any_text_comes_out_as_it_went_in(content, attribute):
    read = _Reader(element("p", content, title=attribute))
    assert (read.found, read.attributes) == (content, {"title": attribute})


def test_markup_stays_markup():
    assert element("p", "1 < 2, ", element("b", "true")) == "<p>1 &lt; 2, <b>true</b></p>"
    assert text(Html("<i>")) == "<i>"
    assert joined("a&", Html("<br>")) == "a&amp;<br>"


def test_attributes_are_spelled_as_html_spells_them():
    assert element("svg", class_="x", aria_label="y", role=None) == '<svg class="x" aria-label="y"></svg>'


def test_columns_of_numbers_are_flush_right_and_others_not():
    rows = [
        ("a", "−1.5", "mm", "–", "1.2 × 10⁻⁵", "0.1 (0.2)"),
        ("b", "< 0.001", "10⁻³ mm", "–", "–", "3 (4)"),
    ]
    page = Page(table("numbers", ["", "value", "unit", "none", "power", "spread"], rows))
    assert [cell.get("class") for cell in page.all("td")[:5]] == ["number", None, None, "number", "number"]
    assert page.tables["numbers"][1:] == [list(row) for row in rows]


def test_a_long_table_may_break_over_pages():
    assert Page(table("t", ["a"], [("x",)] * 30)).all("table") == [{"class": "long"}]
    assert Page(table("t", ["a"], [("x",)])).all("table") == [{}]


def test_facts_have_a_head_for_every_row():
    page = Page(facts("two", [("a", 1), ("b", 2)]))
    assert [head["scope"] for head in page.all("th")] == ["row", "row"]
