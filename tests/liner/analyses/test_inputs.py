"""The inputs of an analysis that nobody asked for: what a device and the profiles of its captures give."""

from pathlib import Path

import pytest
from running import configuration
from sealed_setups import DEVICE, setups_of

from grabberd.config import AnalysisConfig, default_config_file
from grabberd.documents.document import JobProblem
from grabberd.errors import ConfigError
from grabberd.instrument.setup import set_up
from grabberd_liner.analyses.capture_analyses import check_inputs, inputs_of
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
    file, inputs = tmp_path / "grabberd.yaml", tmp_path / "inputs.yaml"
    check_inputs(configuration({}), file)
    inputs.write_text("{colour: red, phases: 1}")
    with pytest.raises(ConfigError) as found:
        check_inputs(configuration({}, analysis=AnalysisConfig(when_sealed=True, inputs=inputs)), file)
    assert "colour" in str(found.value)
    assert "phases" in str(found.value)
