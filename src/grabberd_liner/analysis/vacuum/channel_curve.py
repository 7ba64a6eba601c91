"""A vacuum that was recorded with the capture itself, on the clock of its fields."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from grabberd_liner.analysis.vacuum.vacuum import LoggedVacuum
from grabberd_liner.analysis.vacuum.vacuum_log import VacuumLog


@dataclass(frozen=True, slots=True, eq=False)
class ChannelCurve:
    """K readings of one channel.

    Attributes:
        name: Quantity that it is of.
        time_s: (K,) when each was taken, from the capture's first field on, ascending.
        kpa: (K,) vacuum below atmosphere.
        sigma_kpa: σ of its calibration, common to all readings.
        time_sigma_s: σ of its clock against that of the fields.
        delay_sigma_s: the part of it that is the same for all readings of its logger.
        logger: name of that logger.
        origin: Where it comes from, for people.
        remark: What to know before relying on its times, or None.
    """

    name: str
    time_s: NDArray[np.float64]
    kpa: NDArray[np.float64]
    sigma_kpa: float
    time_sigma_s: float
    origin: str
    remark: str | None = None
    delay_sigma_s: float = 0.0
    logger: str = ""

    def log(self) -> VacuumLog:
        """The readings in the form of a log.

        Raises:
            InputError: There are too few, or they are not vacuum in kPa.
        """
        return VacuumLog(self.time_s, self.kpa, channel=self.name)

    def source(self, offset_s: float, sigma_kpa: float) -> LoggedVacuum:
        """The vacuum at the fields' times.

        Args:
            offset_s: The camera's time less that of the readings.
            sigma_kpa: σ of the calibration.

        Raises:
            InputError: As `log`.
        """
        log = self.log()
        return LoggedVacuum(log, log.pulsation_kpa, offset_s, 0.0, sigma_kpa)
