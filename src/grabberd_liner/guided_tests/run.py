"""A guided test of a liner: analyses its captures, judges them by the recipe, and makes its document."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from grabberd import __version__
from grabberd.archive.calibrations.calibration_catalog import verdict_of
from grabberd.core.geometry.document_reader import finite
from grabberd.documents.document import JsonObject, assembled
from grabberd.errors import GrabberdError, InputError
from grabberd.files.checked_file import write_text
from grabberd.runtime import SystemClock, iso_utc
from grabberd.work.job_spec import Progress, portion
from grabberd_liner.analyses.job import AnalysisOptions, AnalysisOutput, analyse_file, drawn, write_stored
from grabberd_liner.analyses.source import capture_origin, recorded_channels
from grabberd_liner.analyses.store import AnalysisStore
from grabberd_liner.analysis.estimate import Finding
from grabberd_liner.chain.analysis.profile_inputs import Profile
from grabberd_liner.chain.guided_tests.evaluate import evaluate
from grabberd_liner.chain.guided_tests.outcome import Check, Curve, Evidence, Offer, Outcome, worst
from grabberd_liner.chain.guided_tests.recipes import LABEL, RECIPES
from grabberd_liner.guided_tests.documents import (
    LinerTestDocument,
    LinerTestKind,
    ProfileOffer,
    TestCheck,
    TestCurve,
    TestedCapture,
    TestQuantity,
)
from grabberd_liner.guided_tests.report import liner_test_html
from grabberd_liner.guided_tests.store import DOCUMENT, PAGE
from grabberd_liner.profiles.changes import changes_in_words
from grabberd_liner.profiles.profiles import FoundProfiles

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
    return TestCheck(**{**values, "value": finite(one.value), "sigma": finite(one.sigma)})


def _quantity(one: Finding) -> TestQuantity:
    found = {"value": finite(one.value), "sigma": finite(one.sigma), "sigma_common": finite(one.common)}
    return assembled(TestQuantity, one, one.quantity, **found)


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
        y=[finite(value) for value in y],
        sigma=[finite(value) for value in sigma],
    )


def _offer(offer: Offer, one: Evidence) -> ProfileOffer:
    before = dict(one.liner.content) if one.liner else {}
    return ProfileOffer(
        profile=dict(offer.content), after=offer.after, changes=changes_in_words(before, offer.content)
    )


_REFERENCE = "reference"


@dataclass(frozen=True, slots=True)
class LinerTestOutput:
    """A test, and the analysis of each of its captures by id; None where one could not be analysed."""

    document: LinerTestDocument
    analyses: Mapping[str, AnalysisOutput | None]


def store_analyses(store: AnalysisStore, output: LinerTestOutput, job: str) -> list[int]:
    """Stores the analyses, but for those that an earlier attempt has stored; returns their numbers."""
    numbers = []
    for capture, made in output.analyses.items():
        number = store.made_by(capture, job)
        if number is None and made is not None:
            with store.scratch() as folder:
                write_stored(folder, made, job)
                number = store.publish(capture, folder)
        if number is not None:
            numbers.append(number)
    return numbers


def write_liner_test(folder: Path, document: LinerTestDocument) -> tuple[list[Path], str | None]:
    """Writes a test as a document, and as a page if one can be drawn.

    Returns:
        What was written, and why there is no page; None if there is one.

    Raises:
        StorageError: A file cannot be written, or exists.
    """
    written = [write_text(folder / DOCUMENT, document.model_dump_json(by_alias=True, indent=1) + "\n")]
    page = folder / PAGE
    extra, problem = drawn(
        lambda: written.append(write_text(page, liner_test_html(document.model_dump(by_alias=True))))
    )
    lacking = f"the report needs the extra {extra}: pip install 'grabberd[{extra}]'" if extra else problem
    return written, lacking


class _Source(NamedTuple):
    """A capture of a test: its file, its origin, its calibration, its labels and their profiles."""

    path: Path
    about: JsonObject
    calibration: Mapping[str, object]
    found: FoundProfiles

    @property
    def labels(self) -> Mapping[str, str]:
        return self.found.labels

    @property
    def id(self) -> str:
        return str(self.about["id"])


def run_liner_test(
    progress: Progress,
    kind: LinerTestKind,
    files: Sequence[Path],
    found: Callable[[Path], FoundProfiles | None],
    inputs: JsonObject,
    sources: Mapping[str, str] | None = None,
) -> LinerTestOutput:
    """Analyses captures and judges them; nothing is written.

    A capture that cannot be analysed makes a failed check, with the reason.

    Args:
        progress: Called with the share that is done.
        kind: The recipe.
        files: The captures, in any order.
        found: Labels of a capture, and the profiles that they name; None: the labels in its file, no profile.
        inputs: Inputs of the analyses that win over profiles and recipe.
        sources: Where each of the inputs comes from, by its name.

    Raises:
        CaptureFileError, NotFound: A capture cannot be read, or was never measured.
        InputError: The recipe does not evaluate that many captures.
    """
    given = sorted((_source(path, found(path)) for path in files), key=lambda one: one.about["captured_utc"])
    reference, captures = _split(kind, given)
    _check_count(kind, captures)
    evidence, analyses = [], {}
    for at, one in enumerate(captures):
        part = portion(progress, at / len(captures), (at + 1) / len(captures))
        made, problem = _analysed(part, kind, one, reference, inputs, sources or {})
        analyses[one.id] = made
        evidence.append(_evidence(one, made, problem))
    outcome = evaluate(kind, evidence)
    made_of = [(one, analyses[one.id]) for one in captures]
    about = [made.about if made else one.about for one, made in made_of]
    problems = [text for _, made in made_of if made for text in made.analysis.problems]
    judged = list(zip(evidence, about, strict=True))
    return LinerTestOutput(liner_test_document(kind, judged, outcome, problems), analyses)


def _source(path: Path, found: FoundProfiles | None) -> _Source:
    about, calibration = capture_origin(path)
    return _Source(path, about, calibration, found or FoundProfiles(about["labels"], []))


def _split(kind: str, captures: Sequence[_Source]) -> tuple[_Source | None, Sequence[_Source]]:
    """The reference state among the captures of an artificial teat, and the others."""
    if kind != "artificial-teat":
        return None, captures
    of_reference = [one for one in captures if one.labels.get(LABEL) == _REFERENCE]
    others = [one for one in captures if one not in of_reference]
    return (of_reference[-1] if of_reference else None), others


def _check_count(kind: str, captures: Sequence[_Source]) -> None:
    if not captures or (len(captures) > 1 and not RECIPES[kind].several):
        wanted = "several captures" if RECIPES[kind].several else "one capture"
        raise InputError(
            f"the test {kind} evaluates {wanted}, not {len(captures)}",
            "docs/howto/test-a-liner.md describes every test",
        )


def _analysed(
    progress: Progress,
    kind: str,
    one: _Source,
    reference: _Source | None,
    inputs: JsonObject,
    sources: Mapping[str, str],
) -> tuple[AnalysisOutput | None, str]:
    """The analysis of a capture, or why there is none."""
    try:
        given, of_recipe = _inputs(kind, one, reference, inputs)
        made = analyse_file(
            progress,
            path=one.path,
            inputs=given,
            profiles=one.found,
            sources={**of_recipe, **sources},
            options=AnalysisOptions(reference=reference.path if reference else None),
        )
    except GrabberdError as error:
        return None, f"{error.message}; {error.hint}"
    return made, ""


def _inputs(
    kind: str, one: _Source, reference: _Source | None, inputs: JsonObject
) -> tuple[JsonObject, dict[str, str]]:
    """Inputs of a capture's analysis, and where those of the recipe come from.

    What is given wins, then what was recorded with the capture, then the recipe.
    """
    # Wear evaluates captures of other recipes.
    recipe = RECIPES.get(one.labels.get(LABEL, ""), RECIPES[kind]) if kind == "wear" else RECIPES[kind]
    stated = dict(recipe.inputs)
    if reference is not None:
        stated["reference"] = {"capture": reference.id}
    given = inputs.get("vacuum") or {}
    recorded = recorded_channels(one.path)
    of_recipe = {
        name: value
        for name, value in stated.pop("vacuum", {}).items()
        if name not in {*recorded, *given} and "log" not in given
    }
    vacuum = {**of_recipe, **given}
    said = f"the recipe {recipe.kind}"
    from_recipe = [
        *(name for name in stated if name not in inputs),
        *(f"vacuum.{name}" for name in of_recipe),
    ]
    whole = {**stated, **inputs, **({"vacuum": vacuum} if vacuum else {})}
    return whole, dict.fromkeys(from_recipe, said)


def _evidence(one: _Source, made: AnalysisOutput | None, problem: str) -> Evidence:
    liners = [found for found in one.found.profiles if found.kind == "liner"]
    return Evidence(
        id=one.id,
        captured_utc=str(one.about["captured_utc"]),
        labels=one.labels,
        ledger=one.about["ledger"],
        calibration=one.about["calibration"],
        acceptance=verdict_of(one.calibration),
        liner=next((Profile(at.kind, at.name, at.version, at.sha256, at.profile) for at in liners), None),
        captured=made.captured if made else (),
        analysis=made.analysis if made else None,
        tables=made.tables if made else {},
        problem=problem,
    )
