"""The notice on a report whose pressures were found in the earlier, wrong way."""

from grabberd.reports.environment import render

_BEGIN = "<main>"


def marked_outdated(page: str) -> str:
    """Put the notice at the top of a report that was drawn before it was known."""
    notice = render("outdated.html.jinja", {})
    return page.replace(_BEGIN, f"{_BEGIN}\n{notice}", 1)
