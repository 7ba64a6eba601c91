"""Object models that come with the program, each read once a process."""

from functools import cache

from grabberd.bounded_documents import parse_yaml
from grabberd.config import shipped_configs
from grabberd.core.reconstruction import ObjectModel

PAPER = "calibration-frames/paper-108.yaml"


@cache
def shipped_document(name: str) -> dict:
    """What a file of theirs contains; nobody changes it."""
    return parse_yaml((shipped_configs() / name).read_text("utf-8"), fast=True)


@cache
def shipped_model(name: str) -> ObjectModel:
    """The object model of a file; nobody changes it."""
    return ObjectModel.from_document(shipped_document(name))
