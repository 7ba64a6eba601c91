from html.parser import HTMLParser
from importlib.resources import files

import pytest
from hypothesis import given
from hypothesis import strategies as st
from jinja2 import UndefinedError

from grabberd.reports import figures
from grabberd.reports.document import environment
from reports.pages import Page, chapters_left_out

READABLE = st.text(st.characters(exclude_categories=["Cs", "Cc"]))
MACROS = "{% from 'macros.html.jinja' import box, fact, facts, part, table %}"
TEXT = environment().from_string('<p title="{{ attribute }}">{{ text }}</p>')


def written(template, **values):
    return environment().from_string(MACROS + template).render(**values)


def page(template, **values):
    return Page(written(template, **values))


def test_templates_are_found_where_the_package_is_installed():
    folder = files("grabberd.reports").joinpath("templates")
    for name in environment().list_templates():
        assert folder.joinpath(name).is_file()
    assert {"page.html.jinja", "calibration.html.jinja", "style.css"} <= set(environment().list_templates())


def test_every_chapter_is_in_its_report():
    assert not chapters_left_out(environment(), "calibration")


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
def test_any_text_comes_out_as_it_went_in(text, attribute):
    read = _Reader(TEXT.render(text=text, attribute=attribute))
    assert (read.found, read.attributes) == (text, {"title": attribute})


def test_markup_in_values_stays_text_and_figures_stay_figures():
    svg = figures.drawing.Svg("<svg></svg>")
    assert written("{{ text }}{{ svg }}", text="<b>", svg=svg) == "&lt;b&gt;<svg></svg>"


def test_a_key_that_is_missing_is_the_same_as_one_that_is_null():
    for document in ({}, {"part": None}, {"part": {}}, {"part": {"x": None}}):
        assert written("{{ document.part.x is none }}", document=document) == "True"
        assert written("{{ document['part']['x'] | fixed(2) }}", document=document) == "–"


def test_a_key_is_never_taken_for_a_method():
    assert written("{{ known.values }}{{ known.items is none }}", known={"values": 3}) == "3True"


def test_a_misspelt_variable_is_an_error():
    with pytest.raises(UndefinedError, match="documnet"):
        written("{{ documnet.id }}")


def test_columns_of_numbers_are_flush_right_and_others_not():
    cells = {
        "": ["a", "b"],
        "value": ["−1.5", "< 0.001"],
        "unit": ["mm", "10⁻³ mm"],
        "none": ["–", "–"],
        "power": ["1.2 × 10⁻⁵", "–"],
        "spread": ["0.1 (0.2)", "3 (4)"],
    }
    read = page("{{ table('numbers', columns) }}", columns=list(cells.items()))
    assert [cell.get("class") for cell in read.all("td")[:5]] == ["number", None, None, "number", "number"]
    assert read.tables["numbers"] == [list(cells), *map(list, zip(*cells.values(), strict=True))]


def test_a_long_table_may_break_over_pages():
    for rows, attributes in ((30, {"class": "dense long"}), (1, {"class": "dense"})):
        read = page("{{ table('t', [('a', cells)], 'dense') }}", cells=["x"] * rows)
        assert read.all("table") == [attributes]


def test_columns_are_taken_from_rows_and_written_by_filters():
    rows = [{"x": 1.25, "at": [4, 5]}, {"x": None, "at": None}, {}]
    assert written("{{ rows | column('x', 'fixed', 1) | join(' ') }}", rows=rows) == "1.2 – –"
    assert written("{{ rows | column('at.1', 'count') | join(' ') }}", rows=rows) == "5 – –"
    assert written("{{ ['a', 'b'] | lookup({'b': 2}) | map('count') | join(' ') }}") == "– 2"


def test_cells_are_written_by_macros():
    macro = "{% macro cell(row) %} {% if row %}<b>{{ row }}</b>{% endif %} {% endmacro %}"
    assert written(macro + "{{ ['<', ''] | each(cell) | join('|') }}") == "<b>&lt;</b>|"


def test_facts_have_a_head_for_every_row():
    read = page("{% call facts('two') %}{{ fact('a', 1) }}{{ fact('b', 2) }}{% endcall %}")
    assert [head["scope"] for head in read.all("th")] == ["row", "row"]
    assert read.tables["two"] == [["a", "1"], ["b", "2"]]


def test_a_part_is_listed_but_for_one_key_or_said_to_be_missing():
    macro = "{{ part('Glass', glass, 'There is none.', without='b') }}"
    assert page(macro, glass={"a_mm": 1, "b": 2}).tables["Glass"] == [["a [mm]", "1"]]
    assert page(macro, glass=None).text.strip() == "There is none."


def test_many_lines_of_a_box_are_folded_away():
    read = page("{{ box('Problems', lines, 'none', shown=2) }}", lines=["a", "b", "c"])
    assert len(read.all("details")) == 1
    assert "1 more" in read.text
    assert not page("{{ box('Problems', lines, 'none') }}", lines=["a", "b", "c"]).all("details")
