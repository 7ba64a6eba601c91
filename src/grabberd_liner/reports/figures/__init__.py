"""The figures of the liner's reports, drawn as those of the program's."""

from grabberd_liner.reports.figures.curves import phase_svg as phase_svg
from grabberd_liner.reports.figures.curves import profile_svg as profile_svg
from grabberd_liner.reports.figures.curves import time_svg as time_svg
from grabberd_liner.reports.figures.groups import groups_svg as groups_svg
from grabberd_liner.reports.figures.groups import trends_svg as trends_svg
from grabberd_liner.reports.figures.states import State as State
from grabberd_liner.reports.figures.states import maps_svg as maps_svg
from grabberd_liner.reports.figures.states import model_svg as model_svg
from grabberd_liner.reports.figures.states import states_of as states_of
from grabberd_liner.reports.figures.tested import tested_svg as tested_svg
