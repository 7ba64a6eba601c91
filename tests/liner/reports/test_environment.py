from importlib.resources import files

import pytest

from grabberd.reports.document import environment as program
from grabberd_liner.reports.environment import environment
from reports.pages import chapters_left_out


def test_templates_stand_beside_those_of_the_program():
    folder = files("grabberd_liner.reports").joinpath("templates")
    own = set(environment().list_templates()) - set(program().list_templates())
    assert {"analysis.html.jinja", "study.html.jinja", "liner_test.html.jinja"} <= own
    assert all(folder.joinpath(name).is_file() for name in own)


def test_figures_are_none_of_the_program():
    assert "maps_svg" in environment().globals
    assert "maps_svg" not in program().globals


@pytest.mark.parametrize("report", ["analysis", "study"])
def test_every_chapter_is_in_its_report(report):
    assert not chapters_left_out(environment(), report)
