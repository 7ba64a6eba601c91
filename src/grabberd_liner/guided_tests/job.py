"""The job that makes a guided test of a liner; what it runs is imported when it runs."""

from pydantic import Field

from grabberd.documents.document import JsonObject, assembled
from grabberd.documents.requests import CaptureName
from grabberd.work.job_spec import JobContext, JobSpec, Progress, portion
from grabberd_liner.analyses.job import SOURCE
from grabberd_liner.analyses.store import AnalysisStore
from grabberd_liner.guided_tests.documents import LinerTestDocument, LinerTestKind, LinerTestResult
from grabberd_liner.guided_tests.store import LinerTestStore
from grabberd_liner.profiles.profiles import FoundProfiles

_ANALYSED = 0.9
"""Share of the work; the rest is drawing and writing."""


class LinerTestJob(JobSpec):
    """Makes a guided test and stores it under the job's id, whole or not at all.

    Its analyses become analyses of the captures.

    Attributes:
        subject: The newest capture.
        test: The recipe.
        others: The earlier captures, the oldest first; none for a recipe that evaluates one.
        inputs: Inputs of the analyses that win over profiles and recipe.
        profiles: Labels of each capture as they stand, and the profiles that they name, by its id; the labels
            in its file and no profile for one that is left out.
        source: Where the inputs come from, as the report shows it.
    """

    kind = "test"
    test: LinerTestKind
    others: tuple[CaptureName, ...] = ()
    inputs: JsonObject = Field(default_factory=dict)
    profiles: dict[CaptureName, FoundProfiles] = Field(default_factory=dict)
    source: str = SOURCE

    @property
    def captures(self) -> tuple[str, ...]:
        """All captures, the oldest first."""
        return (*self.others, self.subject)

    @property
    def analyses(self) -> tuple[str, ...]:
        """Captures whose analysis it makes."""
        return self.captures

    def run(self, progress: Progress, context: JobContext) -> LinerTestResult:
        """Makes the test and stores it.

        Raises:
            CaptureFileError, NotFound: A capture cannot be read, or was never measured.
            InputError: The recipe does not evaluate that many captures.
        """
        from grabberd_liner.guided_tests.run import run_liner_test, store_analyses, write_liner_test  # noqa: PLC0415 - the daemon does without it

        tests = LinerTestStore(context.folders["tests"])
        if (made := tests.made_by(context.job)) is not None:
            return self._result(made, tests.document(made))
        ids = {context.file(capture): capture for capture in self.captures}
        output = run_liner_test(
            portion(progress, 0.0, _ANALYSED),
            self.test,
            list(ids),
            lambda path: self.profiles.get(ids[path]),
            self.inputs,
            dict.fromkeys(self.inputs, self.source),
        )
        numbers = store_analyses(AnalysisStore(context.folders["analyses"]), output, context.job)
        document = output.document.model_copy(update={"analyses": numbers})
        with tests.scratch() as folder:
            write_liner_test(folder, document)
            tests.publish(context.job, folder)
        return self._result(context.job, document)

    def _result(self, test: str, document: LinerTestDocument) -> LinerTestResult:
        return assembled(LinerTestResult, document, test=test)
