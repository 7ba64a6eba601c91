"""From a grabber's buffers to numbered fields in the ring.

`device` is the contract implemented by every grabber driver, and finds drivers by name, and the devices that
they detect. `numbering` determines which of the camera's fields a grabbed one is, which were lost before it,
and why the program was late, although timestamps jitter and drivers' counters are unreliable;
`content_check` and `shifted_rows` detect damage and a missing signal in the picture itself. The `ring` holds
the newest packed fields for several readers, none of which can delay it. No threads are started here.
"""

from grabberd.instrument.acquisition.content_check import REPEATED as REPEATED
from grabberd.instrument.acquisition.content_check import Content as Content
from grabberd.instrument.acquisition.content_check import ContentCheck as ContentCheck
from grabberd.instrument.acquisition.device import GRABBERS as GRABBERS
from grabberd.instrument.acquisition.device import LOGGERS as LOGGERS
from grabberd.instrument.acquisition.device import FoundDevice as FoundDevice
from grabberd.instrument.acquisition.device import GrabbedField as GrabbedField
from grabberd.instrument.acquisition.device import Grabber as Grabber
from grabberd.instrument.acquisition.device import Signal as Signal
from grabberd.instrument.acquisition.device import StreamInfo as StreamInfo
from grabberd.instrument.acquisition.device import Verdict as Verdict
from grabberd.instrument.acquisition.device import discover as discover
from grabberd.instrument.acquisition.numbering import FieldNumbering as FieldNumbering
from grabberd.instrument.acquisition.numbering import Numbered as Numbered
from grabberd.instrument.acquisition.numbering.standstill import Standstill as Standstill
from grabberd.instrument.acquisition.ring import Backlog as Backlog
from grabberd.instrument.acquisition.ring import Policy as Policy
from grabberd.instrument.acquisition.ring import Ring as Ring
from grabberd.instrument.acquisition.ring import RingReader as RingReader
