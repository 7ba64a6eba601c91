"""The kinds of jobs, by which a queue that outlived the daemon is read."""

from grabberd.library.jobs.calibration_job import CalibrationJob
from grabberd.library.jobs.identification_job import IdentificationJob
from grabberd.library.jobs.measurement import MeasurementJob
from grabberd.server.daemon.check_job import CheckJob
from grabberd.work.job_rows import Kinds
from grabberd_liner.analyses.job import AnalysisJob
from grabberd_liner.guided_tests.job import LinerTestJob

KINDS: Kinds = {
    one.kind: one
    for one in (
        AnalysisJob,
        CalibrationJob,
        CheckJob,
        IdentificationJob,
        LinerTestJob,
        MeasurementJob,
    )
}
