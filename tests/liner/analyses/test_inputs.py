"""The inputs of an analysis that nobody asked for: what a device and the profiles of its captures give."""

from pathlib import Path

import pytest
from running import configuration
from sealed_setups import DEVICE, setups_of

from grabberd.config import default_config_file
from grabberd.documents.document import JobProblem
from grabberd.errors import ConfigError
from grabberd.instrument.setup import set_up
from grabberd_liner.analyses.inputs import inputs_of, problems_of_inputs
from grabberd_liner.profiles.profiles import FoundProfiles


def test_a_device_without_inputs_and_a_label_without_a_profile_say_what_is_missing() -> None:
    setup = set_up(configuration({}), default_config_file())[DEVICE]
    problem = inputs_of(FoundProfiles({"liner": "A"}, []), setup)
    assert isinstance(problem, JobProblem)
    assert "devices.simulated.analysis.inputs" in problem.hint


def test_inputs_that_are_no_document_are_a_problem_of_the_configuration(tmp_path: Path) -> None:
    with pytest.raises(ConfigError, match=r"devices\.simulated\.analysis\.inputs: .*has no keys"):
        setups_of(tmp_path, inputs=[1, 2])  # type: ignore[arg-type]


def test_inputs_that_no_analysis_takes_are_found_by_a_check(tmp_path: Path) -> None:
    assert problems_of_inputs(setups_of(tmp_path), tmp_path / "grabberd.yaml") == []
    wrong = setups_of(tmp_path, inputs={"colour": "red", "phases": 1})
    (found,) = problems_of_inputs(wrong, tmp_path / "grabberd.yaml")
    assert "colour" in str(found)
    assert "phases" in str(found)
