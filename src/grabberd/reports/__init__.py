"""The reports that people read and sign: HTML drawn from a JSON document alone, with its figures.

A report's document holds every number; nothing here measures anything or computes an accuracy of its own. The
text and the order of the chapters stand in `templates/`, one template for each report; `calibration`,
`analysis` and `study` prepare the values that a template cannot take from the document as they are, and
`figures` draws, which needs the extra `report`. `outdated` marks reports that were drawn before their
pressures were known to be wrong.
"""

from grabberd.reports.calibration import calibration_html
from grabberd.reports.document import document_json
from grabberd.reports.outdated import marked_outdated
from grabberd_liner.analyses.report import analysis_html
from grabberd_liner.studies.report import study_html

__all__ = ["analysis_html", "calibration_html", "document_json", "marked_outdated", "study_html"]
