from grabberd.errors import GrabberdError as GrabberdError
from grabberd.library.calibrations import Calibration as Calibration
from grabberd.library.calibrations import calibrate as calibrate
from grabberd.library.connection import Connection as Connection
from grabberd.library.connection import RemoteCapture as RemoteCapture
from grabberd.library.connection import connect as connect
from grabberd.library.examples import example as example
from grabberd.library.tables import PointTable as PointTable
from grabberd_liner.library import Analysis as Analysis
from grabberd_liner.library import Capture as Capture
from grabberd_liner.library import open_capture as open

__version__: str
__all__ = [
    "Analysis",
    "Calibration",
    "Capture",
    "Connection",
    "GrabberdError",
    "PointTable",
    "RemoteCapture",
    "__version__",
    "calibrate",
    "connect",
    "example",
    "open",
]
