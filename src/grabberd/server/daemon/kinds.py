"""The kinds of jobs, by which a queue that outlived the daemon is read."""

from grabberd.extension import extensions, load
from grabberd.library.jobs.calibration_job import CalibrationJob
from grabberd.library.jobs.identification_job import IdentificationJob
from grabberd.library.jobs.measurement import MeasurementJob
from grabberd.server.daemon.check_job import CheckJob
from grabberd.work.job_rows import Kinds

_OF_EXTENSIONS = (load(job) for extension in extensions() for job in extension.jobs)

KINDS: Kinds = {
    one.kind: one for one in (CalibrationJob, CheckJob, IdentificationJob, MeasurementJob, *_OF_EXTENSIONS)
}
