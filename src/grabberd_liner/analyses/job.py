"""Analyses a capture's points: shape, strain, tension and pressure, as tables, maps and a report.

Inputs that are given are completed by profiles and by what was recorded. What computes and draws is imported
where it is used: the daemon declares the job, but never analyses.
"""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, NamedTuple

from pydantic import Field

from grabberd import __version__
from grabberd.core.geometry.document_reader import finite
from grabberd.documents.document import JsonObject
from grabberd.documents.requests import CaptureName
from grabberd.errors import ExtraMissing, InputError
from grabberd.files.checked_file import write_text
from grabberd.runtime import SystemClock, iso_utc
from grabberd.work.job_spec import JobContext, JobSpec, Progress, portion
from grabberd_liner.analyses.documents import (
    PRESSURE_METHOD,
    AnalysisRecord,
    AnalysisResult,
    QuantityDocument,
)
from grabberd_liner.analyses.store import DOCUMENT, PAGE, RECORD, AnalysisStore
from grabberd_liner.profiles.documents import ProfileUse
from grabberd_liner.profiles.profiles import FoundProfiles, plain_name

if TYPE_CHECKING:
    from grabberd.core.reconstruction import Points
    from grabberd_liner.analyses.source import AnalysisSource
    from grabberd_liner.chain.analysis.analyse import Analysis
    from grabberd_liner.chain.analysis.profile_inputs import Profile, ResolvedInputs, Subject
    from grabberd_liner.chain.analysis.tables import AnalysisTables
    from grabberd_liner.chain.analysis.wall_state import FieldPoints


def resolved_inputs(given: JsonObject, found: FoundProfiles | None, subject: "Subject") -> "ResolvedInputs":
    """The inputs, and where those come from that were not given.

    Args:
        given: Inputs that are given; they win.
        found: Profiles that complete them; None: only vacuum that was recorded with the capture does.
        subject: The capture.

    Raises:
        InputError: Profiles contradict the capture.
    """
    from grabberd_liner.chain.analysis.profile_inputs import Profile, resolve, with_recorded

    if found is None:
        return with_recorded(given, subject)
    labels = {key: plain_name(value) for key, value in found.labels.items()}
    known = [Profile(one.kind, one.name, one.version, one.sha256, one.profile) for one in found.profiles]
    return resolve(labels, known, given, subject)


def use_of(profile: "Profile") -> ProfileUse:
    """A profile as a record names it."""
    return ProfileUse(kind=profile.kind, name=profile.name, version=profile.version, sha256=profile.sha256)


SOURCE = "the HTTP request"
"""Where the inputs of a job come from, as the report shows it."""
_ANALYSED = 0.8
"""Share of the work; the rest is drawing and writing."""


class AnalysisOptions(NamedTuple):
    """Choice of what is analysed of a capture, and how.

    Attributes:
        run: The run whose points are analysed; None for the latest.
        pulsating: True to refuse a capture whose wall does not pulsate, but for a ramp with the empty liner.
        reference: Capture of the still liner whose mean is the reference state, where the inputs name it.
    """

    run: int | None = None
    pulsating: bool = False
    reference: Path | None = None


_USUAL = AnalysisOptions()


@dataclass(frozen=True, slots=True)
class AnalysisOutput:
    """An analysis, the same as tables, and the document `about` what it was made from.

    Attributes:
        captured: Fields of the capture as they were taken: those of the analysis may be means of them.
        taken: Inputs that nobody gave, by their names, with where each comes from.
    """

    analysis: "Analysis"
    tables: "AnalysisTables"
    about: JsonObject
    captured: "Sequence[FieldPoints]"
    taken: Mapping[str, str]


class AnalysisJob(JobSpec):
    """Analyses a capture and stores tables, maps and report as its next analysis, whole or not at all.

    Attributes:
        bursts: Ids of the bursts; these and the others as `analyse_file` takes them.
        source: Where the inputs come from, as the report shows it; `sources`: those of them that come from
            elsewhere, by their names.
    """

    kind = "analyse"
    inputs: JsonObject = Field(default_factory=dict)
    bursts: tuple[CaptureName, ...] = ()
    run_number: int | None = None
    vacuum_log: str | None = None
    profiles: FoundProfiles | None = None
    source: str = SOURCE
    sources: dict[str, str] = Field(default_factory=dict)
    pulsating: bool = False

    @property
    def captures(self) -> tuple[str, ...]:
        """The capture and its bursts."""
        return (self.subject, *self.bursts)

    @property
    def analyses(self) -> tuple[str, ...]:
        """The capture; its bursts only add to it."""
        return (self.subject,)

    def run(self, progress: Progress, context: JobContext) -> AnalysisResult:
        """Analyses and stores.

        Raises:
            GrabberdError: As `analyse_file`.
        """
        analyses = AnalysisStore(context.folders["analyses"])
        if (number := analyses.made_by(self.subject, context.job)) is not None:
            record = AnalysisRecord.model_validate(analyses.record(self.subject, number))
            return AnalysisResult(analysis=number, **dict(record))
        made = analyse_file(
            portion(progress, 0.0, _ANALYSED),
            path=context.file(self.subject),
            inputs=with_log(self.inputs, self.vacuum_log),
            bursts=[context.file(burst) for burst in self.bursts],
            profiles=self.profiles,
            sources=dict.fromkeys([*self.inputs, *(["vacuum.log"] if self.vacuum_log else [])], self.source)
            | self.sources,
            options=AnalysisOptions(run=self.run_number, pulsating=self.pulsating),
        )
        with analyses.scratch() as folder:
            record = write_stored(folder, made, context.job)
            return AnalysisResult(analysis=analyses.publish(self.subject, folder), **dict(record))


def analyse_file(
    progress: Progress,
    *,
    path: Path,
    inputs: JsonObject,
    bursts: Sequence[Path] = (),
    profiles: FoundProfiles | None = None,
    sources: Mapping[str, str] | None = None,
    options: AnalysisOptions = _USUAL,
) -> AnalysisOutput:
    """Analyses the points of a capture; nothing is written.

    Args:
        progress: Called with the share that is done.
        path: The capture.
        inputs: What is known besides the points; see `grabberd_liner.chain.analysis.inputs`.
        bursts: Captures of the same liner that are combined with it by phase, each with its latest run.
        profiles: Profiles that complete the inputs, and the capture's labels, by which they were found; None:
            none are used, and its labels are those in its file.
        sources: Where each of the inputs comes from, by its name.
        options: What is analysed of it, and how.

    Raises:
        CaptureFileError, NotFound: A capture or run does not exist.
        NotReady: A capture was measured without an object model.
        InputError: An input or a profile does not suit this capture, or its object model cannot be read.
        AnalysisError: The points make no surface, the clocks are left to a light that is not found, or the
            wall does not pulsate and has to.
    """
    from grabberd_liner.analyses.source import (
        channel_curves,
        check_same_model,
        common_rig,
        found_light,
        read_source,
        recorded_channels,
        single_view,
    )
    from grabberd_liner.analysis.grid import Grid
    from grabberd_liner.chain.analysis.analyse import analyse
    from grabberd_liner.chain.analysis.inputs import read_inputs
    from grabberd_liner.chain.analysis.profile_inputs import Subject
    from grabberd_liner.chain.analysis.tables import tables
    from grabberd_liner.chain.analysis.wall_state import SingleViews, averaged_fields

    recorded = recorded_channels(path)
    # Only the wall's equilibrium can use the rays of a single view.
    single = {"material", "vacuum"} <= _sections(inputs, profiles, bool(recorded))
    # A ramp needs those of a few fields.
    later = inputs.get("teat") == "none" and "average" not in inputs
    captures = [
        read_source(path, options.run, single, later=later),
        *(read_source(burst, None, single) for burst in bursts),
    ]
    check_same_model(captures)
    about = captures[0].about | ({} if profiles is None else {"labels": profiles.labels})
    grid = Grid.of(captures[0].model)
    resolved = resolved_inputs(inputs, profiles, Subject(about["device"], about["object"], grid, recorded))
    channels = channel_curves(path, resolved.inputs)
    read = replace(
        read_inputs(resolved.inputs, grid, channels),
        unmet=tuple(resolved.lacks),
        taken=frozenset(resolved.taken),
    )
    progress(0.0)
    fields = [averaged_fields(capture.fields, read.average) for capture in captures]
    of_reading = tuple(capture.problem for capture in captures if capture.problem)
    light = found_light(path, read.vacuum)
    images = partial(single_view, path, captures[0].fields, options.run) if single and later else None
    analysis = analyse(
        fields,
        grid,
        read,
        lambda done, of: progress(done / max(of, 1)),
        SingleViews(common_rig(captures), images),
        light,
        pulsating=options.pulsating and not read.empty,
        reference=None if options.reference is None else _mean_points(options.reference, captures),
    )
    analysis = replace(analysis, problems=of_reading + analysis.problems)
    of_channels = {f"vacuum.{name}": one.origin for name, one in channels.items()}
    taken = {
        **{name: one for name, one in of_channels.items() if name.partition(".")[2] in read.taken},
        **resolved.sources,
        **read.assumed,
    }
    about = {
        **about,
        "created_utc": iso_utc(SystemClock().utc_now()),
        "version": __version__,
        "pressure_method": PRESSURE_METHOD,
        "bursts": [capture.about["id"] for capture in captures[1:]],
        "profiles": [use_of(one).model_dump() for one in resolved.used],
        "sources": {**(sources or {}), **of_channels, **taken},
    }
    return AnalysisOutput(analysis, tables(analysis), about, captures[0].fields, taken)


def _mean_points(path: Path, captures: "Sequence[AnalysisSource]") -> "Points":
    """The points of a capture of the still wall, averaged over all of its fields."""
    from grabberd_liner.analyses.source import check_same_model, read_source
    from grabberd_liner.chain.analysis.wall_state import averaged_fields

    source = read_source(path, None, False)
    check_same_model([*captures, source])
    if not source.fields:
        raise InputError(f"capture {source.about['id']} has no points", "capture the reference state again")
    (mean,) = averaged_fields(source.fields, len(source.fields))
    return mean.timed.points


def _sections(inputs: JsonObject, found: FoundProfiles | None, recorded: bool) -> set[str]:
    """Inputs that are given, or may come from a profile or from what was recorded with the capture."""
    kinds = {one.kind for one in found.profiles} if found else set()
    of_kinds = {"liner": "material", "pulsator": "vacuum"}
    of_channels = {"vacuum"} if recorded else set()
    return {*inputs, *of_channels, *(name for kind, name in of_kinds.items() if kind in kinds)}


def write_document(folder: Path, made: AnalysisOutput) -> JsonObject:
    """Writes `report.json` and returns its content.

    Raises:
        StorageError: The file cannot be written, or exists.
    """
    from grabberd.reports import document_json
    from grabberd_liner.chain.analysis.analysis_document import analysis_document

    document = analysis_document(made.analysis, made.tables, made.about)
    write_text(folder / DOCUMENT, document_json(document))
    return document


def write_page(folder: Path, document: JsonObject) -> Path:
    """Writes `report.html`.

    Raises:
        ExtraMissing: matplotlib is not installed.
        StorageError: The file cannot be written, or exists.
    """
    from grabberd_liner.analyses.report import analysis_html

    return write_text(folder / PAGE, analysis_html(document))


def with_log(inputs: JsonObject, vacuum_log: str | None) -> JsonObject:
    """Returns the inputs with the text of a vacuum logger's file, in place of the one that they may have.

    Raises:
        InputError: They have no vacuum that says what the log is for.
    """
    if vacuum_log is None:
        return inputs
    vacuum = inputs.get("vacuum")
    if not isinstance(vacuum, Mapping):
        raise InputError(
            "there is a vacuum log, but the inputs of the analysis have no vacuum",
            "state there where the log applies: vacuum: {pulsation: log, liner: log, offset: …}",
        )
    return {**inputs, "vacuum": {**vacuum, "log": vacuum_log}}


def write_stored(folder: Path, made: AnalysisOutput, job: str) -> AnalysisRecord:
    """Writes every file of a stored analysis; returns its record."""
    from grabberd_liner.analyses.export import write_csv
    from grabberd_liner.analyses.store import write_maps
    from grabberd_liner.chain.analysis.analysis_document import map_units, target_maps

    write_csv(folder, made.tables)
    write_maps(folder, target_maps(made.tables, made.analysis.grid), map_units(made.tables))
    document = write_document(folder, made)
    missing_extra, page_problem = drawn(lambda: write_page(folder, document))
    record = AnalysisRecord(
        created_utc=document["created_utc"],
        version=document["version"],
        job=job,
        pressure_method=document["pressure_method"],
        device=made.about["device"],
        run=made.about["run"],
        bursts=made.about["bursts"],
        profiles=made.about["profiles"],
        inputs=document["inputs"]["given"],
        lacks=document["inputs"]["lacks"],
        problems=document["problems"],
        summary={one["name"]: one["values"][0] for one in document["tables"]["summary"]["columns"]},
        quantities=_quantities(made.tables),
        missing_extra=missing_extra,
        page_problem=page_problem,
    )
    write_text(folder / RECORD, record.model_dump_json())
    return record


def _quantities(made: "AnalysisTables") -> list[QuantityDocument]:
    """Rows of the table `quantities`, without definition and source."""
    table = made["quantities"]
    names = ("name", "unit", "value", "sigma_value", "sigma_common", "verdict", "reason")
    rows = zip(*(table.column(name).tolist() for name in names), strict=True)
    return [
        QuantityDocument(
            name=name,
            unit=unit,
            value=finite(value),
            sigma=finite(sigma),
            sigma_common=finite(common),
            verdict=verdict,
            reason=reason,
        )
        for name, unit, value, sigma, common, verdict, reason in rows
    ]


def drawn(draw: Callable[[], object]) -> tuple[str | None, str | None]:
    """Draws a page; returns the extra that is missing, or another reason why there is none.

    A bug in a picture must not cost the numbers.
    """
    try:
        draw()
    except ExtraMissing as error:
        return error.extra, None
    except Exception as error:
        return None, f"{type(error).__name__}: {error}"
    return None, None
