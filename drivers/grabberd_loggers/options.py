"""Options of a driver, read from a configuration with all problems at once."""

from collections.abc import Mapping
from typing import Any, TypeVar

from pydantic import BaseModel, ConfigDict, Field, ValidationError, field_validator

from grabberd.bounded_documents import as_written
from grabberd.errors import said
from grabberd_loggers.lines import LineFormat

Model = TypeVar("Model", bound=BaseModel)


class Options(BaseModel):
    """Options that refuse what they do not know."""

    model_config = ConfigDict(extra="forbid", frozen=True)
    _as_written = field_validator("*", mode="wrap")(as_written)


class LineOptions(Options):
    """Options of every logger that delivers lines of text.

    Attributes:
        columns: columns of a line, written as in a header; by default the logger sends a header.
        rate_hz: readings per second, if the logger reads at a steady rate and sends no time of its own.
    """

    columns: tuple[str, ...] | None = None
    rate_hz: float | None = Field(None, gt=0, le=100_000, allow_inf_nan=False)

    @field_validator("columns")
    @classmethod
    def _usable(cls, columns: tuple[str, ...] | None) -> tuple[str, ...] | None:
        if columns is not None:
            LineFormat.of_columns(columns)
        return columns

    @property
    def line_format(self) -> LineFormat | None:
        """The lines' format; None if the logger tells it by a header."""
        return None if self.columns is None else LineFormat.of_columns(self.columns)


def read_options(model: type[Model], values: Mapping[str, Any]) -> Model:
    """The options of a configuration.

    Raises:
        ValueError: an option is unknown, missing or not allowed; the message has a line for each.
    """
    try:
        return model.model_validate(dict(values))
    except ValidationError as error:
        raise ValueError("\n".join(_in_words(model, one) for one in error.errors())) from None


def _in_words(model: type[BaseModel], problem: Any) -> str:
    key = ".".join(str(part) for part in problem["loc"]) or "options"
    if problem["type"] == "extra_forbidden":
        return f"{key}: unknown option; known are {', '.join(model.model_fields)}"
    if problem["type"] == "missing":
        return f"{key}: missing"
    message, given = said(problem["msg"]), repr(problem["input"])
    return f"{key}: {message}" if given in message else f"{key}: {message}, not {given}"
