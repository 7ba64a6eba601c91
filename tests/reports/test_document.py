import json
import math

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from grabberd.errors import InputError
from grabberd.reports import document_json
from reports.documents import least

VALUES = st.recursive(
    st.none() | st.booleans() | st.integers() | st.floats(allow_nan=False, allow_infinity=False) | st.text(),
    lambda inner: st.lists(inner, max_size=4) | st.dictionaries(st.text(), inner, max_size=4),
    max_leaves=12,
)


@settings(max_examples=40)
@given(st.dictionaries(st.text(), VALUES, max_size=6))
def test_the_json_is_the_document(document):
    assert json.loads(document_json(document)) == document


@settings(max_examples=40)
@given(st.dictionaries(st.text(), VALUES, max_size=6))
def test_the_order_of_keys_does_not_matter(document):
    assert document_json(dict(reversed(document.items()))) == document_json(document)


def test_every_part_has_a_line_of_its_own():
    lines = document_json(least()).splitlines()
    assert len(lines) == len(least()) + 2
    assert lines[1].startswith('"acceptance": ')


@pytest.mark.parametrize("wrong", [math.nan, math.inf, -math.inf])
def test_what_is_no_number_is_refused_with_its_place(wrong):
    document = least() | {"residuals": [{"dx_px": 0.1}, {"dx_px": wrong}]}
    with pytest.raises(InputError, match=r"residuals\[1\]\.dx_px is not a finite number"):
        document_json(document)
