"""The tables of a study."""

import numpy as np
import pytest
from scipy import stats

from grabberd.reports import document_json
from grabberd_liner.chain.study.study import StudyQuestion, make_study
from grabberd_liner.chain.study.study_document import study_document, tables
from liner.chain.study.captured import COMPRESSION, OPENING, capture, herd

QUESTION = StudyQuestion(by="liner", within="cow", over="milkings")
STUDY = make_study(QUESTION, herd())
TABLES = tables(STUDY)


def test_captures_have_a_row_each_and_three_columns_a_quantity() -> None:
    captures = TABLES["captures"]
    assert len(captures) == 12
    names = [column.name for column in captures.columns]
    at = names.index(COMPRESSION)
    assert names[at : at + 3] == [COMPRESSION, f"sigma_{COMPRESSION}", f"sigma_common_{COMPRESSION}"]
    assert {"label_cow", "label_liner", "label_milkings"} <= set(names)
    assert captures.column(f"sigma_common_{COMPRESSION}").tolist() == [0.1] * 12
    assert captures.column(OPENING)[3] == STUDY.captures[3].found[OPENING].value


def test_every_quantity_has_a_row_a_group_and_a_row_a_pair() -> None:
    assert len(TABLES["groups"]) == 2 * 3
    assert len(TABLES["comparison"]) == 2 * 3
    pairs = zip(TABLES["comparison"].column("first"), TABLES["comparison"].column("second"), strict=True)
    assert list(pairs)[:3] == [("A", "B"), ("A", "C"), ("B", "C")]


def test_the_interval_is_that_of_students_t() -> None:
    row = {name: values[0] for name, values in TABLES["comparison"].rows.items()}
    half = stats.t.ppf(0.975, row["dof"]) * row["sigma_difference"]
    assert (row["low"], row["high"]) == pytest.approx((row["difference"] - half, row["difference"] + half))
    assert row["t"] == pytest.approx(row["difference"] / row["sigma_difference"])
    assert row["p"] == pytest.approx(2 * stats.t.sf(abs(row["t"]), row["dof"]))
    assert row["adjusted_p"] >= row["p"]


def test_the_trend_has_a_row_a_group_and_one_for_all() -> None:
    assert TABLES["trend"].column("group").tolist() == ["A", "B", "C", ""] * 2
    assert set(TABLES["trend"].column("over")) == {"milkings"}


def test_without_captures_the_tables_are_there_and_empty() -> None:
    empty = tables(make_study(QUESTION, [capture(0)._replace(labels={})]))
    assert [len(empty[name]) for name in ("captures", "groups", "comparison", "trend")] == [0, 0, 0, 0]
    assert len(empty["left_out"]) == 1


def test_what_cannot_be_tested_is_empty_and_named() -> None:
    alone = tables(make_study(StudyQuestion(by="liner"), [capture(0, "A"), capture(1, "B")]))["comparison"]
    assert np.isnan([alone.column(name)[0] for name in ("dof", "t", "p", "low", "high")]).all()
    assert alone.column("basis")[0] == "own σ alone"
    assert alone.column("verdict")[0] == "not tested"


def test_the_document_is_json_with_every_value_and_the_tables() -> None:
    document = study_document(STUDY, TABLES, {"created_utc": "2026-11-02T00:00:00Z", "version": "1"})
    assert '"schema": "grabberd/study/1"' in document_json(document)
    compression = document["quantities"][0]
    assert compression["values"]["capture"] == [f"c{n:03d}" for n in range(12)]
    assert compression["values"]["sigma"] == pytest.approx([0.15] * 12)
    assert set(document["tables"]) == set(TABLES)
