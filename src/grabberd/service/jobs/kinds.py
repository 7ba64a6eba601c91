"""The kinds of jobs, by which a queue that outlived the daemon is read."""

from grabberd.service.jobs.analysis import AnalysisJob
from grabberd.service.jobs.calibration_job import CalibrationJob
from grabberd.service.jobs.check_job import CheckJob
from grabberd.service.jobs.identification_job import IdentificationJob
from grabberd.service.jobs.job_rows import Kinds
from grabberd.service.jobs.liner_test import LinerTestJob
from grabberd.service.jobs.measurement import MeasurementJob

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
