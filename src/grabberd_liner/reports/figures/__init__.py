"""The figures of the liner's reports, drawn as those of the program's."""

from grabberd_liner.reports.figures.curves import phase_svg, profile_svg, time_svg
from grabberd_liner.reports.figures.groups import groups_svg, trends_svg
from grabberd_liner.reports.figures.states import State, maps_svg, model_svg, states_of
from grabberd_liner.reports.figures.tested import tested_svg

__all__ = [
    "State",
    "groups_svg",
    "maps_svg",
    "model_svg",
    "phase_svg",
    "profile_svg",
    "states_of",
    "tested_svg",
    "time_svg",
    "trends_svg",
]
