"""The reports that people read and sign: HTML drawn from a JSON document alone, with its figures.

A report's document holds every number; nothing here measures anything or computes an accuracy of its own. The
text and the order of the chapters stand in `templates/`, one template for each report; `calibration` prepares
the values that a template cannot take from the document as they are, and `figures` draws, which needs the
extra `report`.
"""

from grabberd.reports.calibration import calibration_html
from grabberd.reports.document import document_json

__all__ = ["calibration_html", "document_json"]
