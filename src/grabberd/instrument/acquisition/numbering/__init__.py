"""Number of a grabbed field among the camera's fields, from all evidence together.

The evidence is the driver's timestamp and count, the field's parity and its arrival. Each may be wrong, so
several hypotheses are kept until one explains everything received (`paths`). `field_numbering` connects the
parts: when a field came (`arrivals`), the camera's field period (`pace`), when the program took none
(`standstill`), what is known of a waiting field (`pending`), when its number is settled and what remains
uncertain (`settling`), which buffers came out of turn (`turns`), what lost the fields before it (`causes`),
and its time (`timing`). docs/reference/numbering.md derives the costs.
"""

from grabberd.instrument.acquisition.numbering.field_numbering import FieldNumbering, Numbered

__all__ = ["FieldNumbering", "Numbered"]
