"""What people read and sign: HTML drawn from a JSON document alone, with its figures.

A report's document holds every number; nothing here measures or computes an accuracy of its own. Each chapter
turns one part of the document into text and tables, each figure one part into a picture; figures need the
extra `report`.
"""

from grabberd.reports.analysis import analysis_html
from grabberd.reports.calibration import calibration_html
from grabberd.reports.document import document_json

__all__ = ["analysis_html", "calibration_html", "document_json"]
