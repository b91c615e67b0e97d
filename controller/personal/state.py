"""A study as a file: what may be proposed, what was tried, what was answered, what is asked. One JSON document."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Final, Literal, Self

import numpy as np
from pydantic import BaseModel, ConfigDict, Field, ValidationError, model_validator

from bridge.command_line.output import write_text
from bridge.errors import SurefootError
from controller.personal.search import Plan, Question, first_settings, liked, next_question
from controller.personal.space import Parameter, Space
from controller.personal.surrogate import Answer, Felt

FORMAT: Final = 1
FILE: Final = "state.json"


class StudyError(SurefootError):
    """A study that is missing, damaged, over, or of other bounds than the configuration."""


class _Part(BaseModel):
    model_config = ConfigDict(extra="forbid", frozen=True, allow_inf_nan=False)


class Side(_Part):
    """One parameter of the study, as `Parameter` has it."""

    key: str
    low: float = Field(gt=0)
    high: float = Field(gt=0)
    present: float = Field(gt=0)


class Reply(_Part):
    """One answer: the settings a and b by their indices, and which felt better."""

    a: int = Field(ge=0)
    b: int = Field(ge=0)
    felt: Literal["a", "b", "same"]


class Study(_Part):
    """Everything there is to know, and the open question; frozen: an answer makes another one."""

    format: Literal[1] = 1
    axes: tuple[str, ...]
    parameters: tuple[Side, ...]
    comparisons: int = Field(ge=1, le=200)
    seed: int = Field(ge=0)
    settings: tuple[tuple[float, ...], ...]  # tried or asked about; in the units of the keys
    replies: tuple[Reply, ...] = ()
    asked: tuple[int, int] | None  # a and b of the open question; None: the study is over

    @model_validator(mode="after")
    def _holds_together(self) -> Self:
        if any(len(setting) != len(self.parameters) for setting in self.settings):
            raise ValueError(f"settings: expected {len(self.parameters)} numbers in each")
        for setting in self.settings:
            for value, side in zip(setting, self.parameters, strict=True):
                if not side.low <= value <= side.high:
                    raise ValueError(f"settings: {side.key} = {value:g} is outside {side.low:g} .. {side.high:g}")
        pairs = [(reply.a, reply.b) for reply in self.replies] + ([self.asked] if self.asked else [])
        for number, (a, b) in enumerate(pairs):
            if a == b or max(a, b) != number + 1:
                raise ValueError(f"comparison {number + 1} is between {a} and {b}: expected setting {number + 1} in it")
        if len(self.settings) != len(pairs) + 1:
            raise ValueError(f"settings: there are {len(self.settings)}, expected {len(pairs) + 1}")
        if (self.asked is None) != (len(self.replies) >= self.comparisons):
            raise ValueError(f"{len(self.replies)} of {self.comparisons} answers and the open question do not agree")
        return self

    @property
    def over(self) -> bool:
        """Whether all answers are there."""
        return self.asked is None

    @property
    def answers(self) -> list[Answer]:
        """The answers as the surrogate takes them."""
        felt = {"a": Felt.FIRST, "b": Felt.SECOND, "same": Felt.SAME}
        return [Answer(reply.a, reply.b, felt[reply.felt]) for reply in self.replies]

    def best(self, space: Space) -> int:
        """Return which of the settings is liked best."""
        return liked(space, np.array(self.settings), self.answers)

    def values(self, index: int) -> dict[str, float]:
        """Return one setting as keys of [admittance] and their values."""
        return {side.key: value for side, value in zip(self.parameters, self.settings[index], strict=True)}

    def answered(self, space: Space, felt: Literal["a", "b", "same"]) -> Study:
        """Return the study after an answer to the open question.

        Raises:
            StudyError: none is open.
        """
        if self.asked is None:
            raise StudyError(f"all {self.comparisons} comparisons are answered")
        replies = (*self.replies, Reply(a=self.asked[0], b=self.asked[1], felt=felt))
        return _with_question(space, self.model_copy(update={"replies": replies}))

    def taken_back(self) -> Study:
        """Return the study before the last answer: its question is open again.

        Raises:
            StudyError: there is none.
        """
        if not self.replies:
            raise StudyError("there is no answer to take back")
        last = self.replies[-1]
        update = {
            "replies": self.replies[:-1],
            "asked": (last.a, last.b),
            "settings": self.settings[: len(self.replies) + 1],
        }
        return self.model_copy(update=update)


def begin(space: Space, axes: tuple[str, ...], plan: Plan) -> Study:
    """Return a study with its first question."""
    sides = tuple(Side(key=side.key, low=side.low, high=side.high, present=side.present) for side in space.parameters)
    study = Study.model_construct(
        axes=axes,
        parameters=sides,
        comparisons=plan.comparisons,
        seed=plan.seed,
        settings=tuple(map(tuple, first_settings(space).tolist())),
        replies=(),
        asked=None,
    )
    return _with_question(space, study)


def _with_question(space: Space, study: Study) -> Study:
    plan = Plan(study.comparisons, study.seed)
    if len(study.replies) >= plan.comparisons:
        return study.model_copy(update={"asked": None})
    settings = np.array(study.settings)
    question: Question = next_question(space, plan, settings, study.answers)
    grown = tuple(map(tuple, question.settings.tolist()))
    return study.model_copy(update={"settings": grown, "asked": (question.a, question.b)})


def extended(study: Study, space: Space, comparisons: int) -> Study:
    """Return the study with another number of comparisons; one that was over goes on.

    Raises:
        StudyError: more are answered already.
    """
    if comparisons < len(study.replies):
        raise StudyError(f"--comparisons {comparisons}: {len(study.replies)} are answered already")
    longer = study.model_copy(update={"comparisons": comparisons})
    if longer.over or len(longer.replies) == comparisons:
        settings = study.settings[: len(study.replies) + 1]
        return _with_question(space, longer.model_copy(update={"settings": settings}))
    return longer


def require_same(study: Study, space: Space, name: str) -> None:
    """Raise unless `study` asks about what the configuration allows now.

    Raises:
        StudyError: names the first parameter that differs.
    """
    keys, known = [side.key for side in study.parameters], [side.key for side in space.parameters]
    if keys != known:
        raise StudyError(f"{name}: asks about {', '.join(keys)}, expected {', '.join(known)}: --force begins anew")
    for side, now in zip(study.parameters, space.parameters, strict=True):
        if Parameter(side.key, side.low, side.high, side.present) != now:
            raise StudyError(
                f"{name}: was begun with admittance.{side.key} = {side.present:g} in {side.low:g} .. {side.high:g}, "
                f"the configuration says {now.present:g} in {now.low:g} .. {now.high:g}: --force begins anew"
            )


def load(path: Path) -> Study:
    """Return the study in `path`.

    Raises:
        StudyError: it is not there, damaged, or of another version.
    """
    try:
        content = json.loads(path.read_text(encoding="utf-8"))
    except FileNotFoundError as error:
        raise StudyError(f"{path}: no study there yet; surefoot personalise next begins one") from error
    except (OSError, ValueError) as error:
        raise StudyError(f"{path}: cannot be read: {error}") from error
    found = content.get("format") if isinstance(content, dict) else None
    if found != FORMAT:
        raise StudyError(f"{path}: is of format {found}, this version reads {FORMAT}: --force begins anew")
    try:
        return Study.model_validate(content)
    except ValidationError as error:
        first = error.errors()[0]
        where = "".join(f"{part}." for part in first["loc"]).rstrip(".")
        said = first["msg"].removeprefix("Value error, ")
        raise StudyError(f"{path}: {where}: {said}" if where else f"{path}: {said}") from error


def save(study: Study, path: Path) -> None:
    """Write `study`, whole or not at all.

    Raises:
        SurefootError: it cannot be written.
    """
    write_text(path, study.model_dump_json(indent=1) + "\n", "--out")
