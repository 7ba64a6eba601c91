"""Reports in a real browser: no table or figure is wider than the page, on a screen and on paper."""

from pathlib import Path

import pytest
from playwright.sync_api import Browser

from grabberd.reports import calibration_html
from grabberd_liner.analyses.report import analysis_html
from liner.reports import analysis_documents
from reports import documents

TOO_WIDE = """() => [...document.querySelectorAll('table, svg, .equations')].flatMap((one) => {
    const page = document.querySelector('main');
    const edge = page.getBoundingClientRect().right - parseFloat(getComputedStyle(page).paddingRight);
    const over = one.getBoundingClientRect().right - edge;
    return over > 1 ? [`${one.caption?.textContent ?? one.tagName} by ${over.toFixed(0)} px`] : [];
})"""
SCREEN, A4 = {"width": 1200, "height": 900}, {"width": 658, "height": 900}
"""Paper of 210 mm without margins of 18 mm has 658 px of 1/96 inch."""


@pytest.mark.parametrize("report", ["calibration", "analysis"])
def test_nothing_of_a_report_is_clipped(browser: Browser, tmp_path: Path, report: str) -> None:
    made = {"calibration": (calibration_html, documents), "analysis": (analysis_html, analysis_documents)}
    html, source = made[report]
    file = tmp_path / "report.html"
    file.write_text(html(source.full()), encoding="utf-8")
    page = browser.new_page(viewport=SCREEN)
    page.goto(file.as_uri())
    assert page.evaluate(TOO_WIDE) == []
    page.emulate_media(media="print")
    page.set_viewport_size(A4)
    assert page.evaluate(TOO_WIDE) == []
    page.close()
