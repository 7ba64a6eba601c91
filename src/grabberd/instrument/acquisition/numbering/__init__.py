"""Number of a grabbed field among the camera's, by all evidence at once.

The evidence is the driver's timestamp and count, the field's parity and its arrival. Each may be wrong, so
several hypotheses are kept until one explains everything that has come (`paths`). `field_numbering` leads
through it: what a field brings (`stamps`, `arrivals`, `sequence_steps`), how long its camera takes for one
(`pace`), when its number is settled (`settling`) and what is doubtful about it (`doubts`), what was lost
before it (`losses`), and its time (`timing`). docs/reference/numbering.md derives the costs.
"""

from grabberd.instrument.acquisition.numbering.field_numbering import FieldNumbering
from grabberd.instrument.acquisition.numbering.numbered import Numbered

__all__ = ["FieldNumbering", "Numbered"]
