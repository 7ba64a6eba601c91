"""The document of a guided test, from what its evaluation found."""

import math
from collections.abc import Sequence
from typing import Any

import numpy as np

from grabberd import __version__
from grabberd.clock import SystemClock, iso_utc
from grabberd.documents.named_types import JsonObject
from grabberd_liner.analysis.quantity import Finding
from grabberd_liner.chain.guided_tests.check import Check, worst
from grabberd_liner.chain.guided_tests.outcome import Curve, Evidence, Offer, Outcome
from grabberd_liner.guided_tests.documents import (
    LinerTestDocument,
    LinerTestKind,
    ProfileOffer,
    TestCheck,
    TestCurve,
    TestedCapture,
    TestQuantity,
)
from grabberd_liner.profiles.changes import changes_in_words

_MOST_POINTS = 400
"""Of a curve: more cannot be told apart on a page."""


def liner_test_document(
    kind: LinerTestKind,
    captures: Sequence[tuple[Evidence, JsonObject]],
    outcome: Outcome,
    problems: Sequence[str],
) -> LinerTestDocument:
    """The document.

    Args:
        kind: The recipe.
        captures: Captures that were evaluated, the oldest first, each with its origin.
        outcome: What was found.
        problems: Problems of their analyses.
    """
    liners = {one.labels.get("liner") for one, _ in captures}
    newest, _ = captures[-1]
    return LinerTestDocument(
        schema="grabberd/liner-test/1",
        kind=kind,
        liner=liners.pop() if len(liners) == 1 else None,
        captures=[_capture(one, about) for one, about in captures],
        created_utc=iso_utc(SystemClock().utc_now()),
        version=__version__,
        verdict=worst(outcome.checks),
        checks=[_check(one) for one in outcome.checks],
        quantities=[_quantity(one) for one in outcome.findings],
        curves=[_curve(one) for one in outcome.curves],
        problems=list(dict.fromkeys(problems)),
        offer=_offer(outcome.offer, newest) if outcome.offer else None,
    )


def _capture(one: Evidence, about: JsonObject) -> TestedCapture:
    return TestedCapture(
        id=one.id,
        captured_utc=one.captured_utc,
        device=about["device"],
        run=about["run"],
        bits=about["bits"],
        calibration=about["calibration"],
        object_model=about["object"],
        labels=dict(one.labels),
        profiles=about.get("profiles", []),
    )


def _check(one: Check) -> TestCheck:
    values: dict[str, Any] = one._asdict()
    return TestCheck(**{**values, "value": _known(one.value), "sigma": _known(one.sigma)})


def _quantity(one: Finding) -> TestQuantity:
    return TestQuantity(
        name=one.quantity.name,
        title=one.quantity.title,
        definition=one.quantity.definition,
        unit=one.quantity.unit,
        value=_known(one.value),
        sigma=_known(one.sigma),
        sigma_common=_known(one.common),
        verdict=one.verdict,
        reason=one.reason,
    )


def _curve(one: Curve) -> TestCurve:
    every = -(-len(one.x) // _MOST_POINTS)
    known = np.isfinite(one.x)
    (x_title, x_unit), (y_title, y_unit) = one.axes
    x, y, sigma = (part[known][::every].tolist() for part in (one.x, one.y, one.sigma))
    return TestCurve(
        name=one.name,
        title=one.title,
        x_title=x_title,
        x_unit=x_unit,
        y_title=y_title,
        y_unit=y_unit,
        style=one.style,
        x=x,
        y=[_known(value) for value in y],
        sigma=[_known(value) for value in sigma],
    )


def _offer(offer: Offer, one: Evidence) -> ProfileOffer:
    before = dict(one.liner.content) if one.liner else {}
    return ProfileOffer(
        profile=dict(offer.content),
        after=offer.after,
        changes=changes_in_words(before, offer.content),
    )


def _known(value: float) -> float | None:
    return float(value) if math.isfinite(value) else None
