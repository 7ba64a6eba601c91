"""Number of a grabbed field among the camera's, by all evidence at once.

The evidence is the driver's timestamp and count, the field's parity and its arrival. Each may be wrong, so
several hypotheses are kept until one explains everything that has come (`paths`). `field_numbering` leads
through it: when a field came (`arrivals`), how long its camera takes for one (`pace`), what is known of it
while it waits and what was lost before it (`pending`), when its number is settled and what is doubtful about
it (`settling`), and its time (`timing`). docs/reference/numbering.md derives the costs.
"""

from grabberd.instrument.acquisition.numbering.field_numbering import FieldNumbering, Numbered

__all__ = ["FieldNumbering", "Numbered"]
