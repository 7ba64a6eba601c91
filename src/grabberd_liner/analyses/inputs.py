"""The inputs with which a sealed capture is analysed, or tested, by itself."""

from collections.abc import Iterator
from pathlib import Path

from grabberd.config import Config
from grabberd.documents.document import JobProblem, JsonObject
from grabberd.errors import ConfigError, GrabberdError, Problem
from grabberd.instrument.setup import DeviceSetup, set_up
from grabberd_liner.chain.guided_tests.recipes import Recipe
from grabberd_liner.profiles.profiles import FoundProfiles

_STATED = {"liner": ("material",), "pulsator": ("vacuum",), "cow": ("flow_stop",)}
"""Inputs that come from a profile, by its kind."""


def inputs_of(found: FoundProfiles, device: DeviceSetup) -> JsonObject | JobProblem:
    """The inputs of a capture's analysis, to be completed by its profiles, or why there are none.

    Args:
        found: Profiles that the capture's labels name.
        device: The device that captured it.
    """
    if device.analysis_inputs is None and not found.profiles:
        return JobProblem(
            message=f"device {device.name} names no inputs for the analysis of its captures, and the labels"
            " of this one name no profile",
            hint=f"name a file in the configuration, devices.{device.name}.analysis.inputs, or label"
            " captures with the name of a liner's profile",
        )
    return device.analysis_inputs or {}


def inputs_of_test(recipe: Recipe, found: FoundProfiles, device: DeviceSetup) -> JsonObject:
    """The device's inputs for the analyses of a guided test.

    Left out is what the recipe or a profile states, since the test is of that liner and of that recipe; and
    without a teat the vacuum, since the configuration states that of a milking.

    Args:
        recipe: The recipe.
        found: Profiles that the capture's labels name.
        device: The device that captured it.
    """
    stated = {*recipe.inputs, *(["vacuum"] if recipe.teat is False else [])}
    for one in found.profiles:
        stated |= {*_STATED.get(one.kind, ()), *one.profile.get("analysis", {})}
    return {key: value for key, value in (device.analysis_inputs or {}).items() if key not in stated}


def check_inputs(config: Config, file: Path) -> None:
    """Checks captures' analyses with their devices' inputs, as far as they are known beforehand.

    Raises:
        ConfigError: They cannot be made.
    """
    try:
        setups = set_up(config, file)
    except ConfigError:  # which is said of the devices
        return
    if problems := [problem for setup in setups.values() for problem in _problems(setup, file)]:
        raise ConfigError(problems)


def _problems(setup: DeviceSetup, file: Path) -> Iterator[Problem]:
    key = f"devices.{setup.name}.analysis"
    if setup.config.analysis.when_sealed and not setup.documents.get("object"):
        words = "captures without an object model have no points: name one"
        yield Problem(str(file), f"{key}.when_sealed", words)
    if setup.analysis_inputs is None or not setup.documents.get("object"):
        return
    # Not at the head: the daemon reads inputs, but never analyses.
    from grabberd.core.reconstruction import ObjectModel  # noqa: PLC0415
    from grabberd_liner.analysis.grid import Grid  # noqa: PLC0415
    from grabberd_liner.chain.analysis.inputs import read_inputs  # noqa: PLC0415

    try:
        read_inputs(setup.analysis_inputs, Grid.of(ObjectModel.from_document(setup.documents["object"])))
    except GrabberdError as error:
        yield Problem(str(file), f"{key}.inputs", f"{error.message}; {error.hint}")
