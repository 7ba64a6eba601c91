"""The chapters of a report: functions from the document to markup, silent about no part that is null."""
