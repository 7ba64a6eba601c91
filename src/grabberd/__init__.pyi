from grabberd.errors import GrabberdError as GrabberdError
from grabberd.public.analysis import Analysis as Analysis
from grabberd.public.calibrations import Calibration as Calibration
from grabberd.public.calibrations import calibrate as calibrate
from grabberd.public.capture import Capture as Capture
from grabberd.public.capture import open_capture as open
from grabberd.public.connection import Connection as Connection
from grabberd.public.connection import RemoteCapture as RemoteCapture
from grabberd.public.connection import connect as connect
from grabberd.public.examples import example as example
from grabberd.public.point_table import PointTable as PointTable

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
