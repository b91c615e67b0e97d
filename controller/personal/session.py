"""A study in its folder: what stands on the disk after every answer is what the next command goes on from."""

from __future__ import annotations

from pathlib import Path
from typing import Any, Final, Literal, Self

import numpy as np

from bridge.command_line.output import write_text
from bridge.config.load import load_config
from controller.personal.proposals import AXES, space_of
from controller.personal.save import fragment_text, setting_text
from controller.personal.search import COMPARISONS_PER_PARAMETER, Plan, surrogate_of
from controller.personal.space import Space
from controller.personal.state import FILE, Study, StudyError, begin, extended, load, require_same, save
from controller.personal.surrogate import agreement

Choice = Literal["a", "b", "same"]
RESULT: Final = "personal.toml"
DEFAULT_AXES: Final = ("forward",)


class Session:
    """A study, the space it asks about, and the files beside it.

    `state.json` is the study; `a.toml` and `b.toml` are the user's configuration with the two settings of the open
    question; `personal.toml` is it with the setting liked best, once the study is over.
    """

    def __init__(self, folder: Path, config: Path | None, space: Space, study: Study) -> None:
        self.folder, self._config, self._space, self.study = folder, config, space, study

    @classmethod
    def open(
        cls,
        folder: Path,
        config: Path | None,
        *,
        axes: tuple[str, ...] | None = None,
        comparisons: int | None = None,
        seed: int = 0,
        anew: bool = False,
    ) -> Self:
        """Go on with the study in `folder`, or begin one there.

        Args:
            folder: of the study.
            config: the user's configuration; None: the defaults.
            axes: of `AXES`; None: those of the study that is there, else forward.
            comparisons: in all; None: those of the study that is there, else six for each parameter.
            seed: of a study that begins.
            anew: forget what is there.

        Raises:
            SurefootError: a study of other axes or bounds is there, or it is damaged, or cannot be written.
        """
        loaded = load_config(config)
        path = folder / FILE
        if anew or not path.exists():
            chosen = axes or DEFAULT_AXES
            space = space_of(loaded, _known(chosen))
            count = comparisons or COMPARISONS_PER_PARAMETER * len(space.parameters)
            session = cls(folder, config, space, begin(space, chosen, Plan(count, seed)))
        else:
            study = load(path)
            if axes is not None and axes != study.axes:
                raise StudyError(
                    f"{path}: asks about {','.join(study.axes)}, not {','.join(axes)}: take another folder (--out), or "
                    "--force to begin anew"
                )
            space = space_of(loaded, _known(study.axes))
            require_same(study, space, str(path))
            if comparisons is not None and comparisons != study.comparisons:
                study = extended(study, space, comparisons)
            session = cls(folder, config, space, study)
        session._keep(session.study)
        return session

    def answer(self, choice: Choice) -> None:
        """Take an answer to the open question."""
        self._keep(self.study.answered(self._space, choice))

    def take_back(self) -> None:
        """Open the last question again."""
        self._keep(self.study.taken_back())

    def file(self, name: str) -> Path:
        """Return the configuration with setting `name`, a or b, of the open question."""
        return self.folder / f"{name}.toml"

    def question(self) -> dict[str, dict[str, float]]:
        """Return the settings a and b of the open question; empty if there is none."""
        study = self.study
        return {} if study.asked is None else dict(zip("ab", map(study.values, study.asked), strict=True))

    def best(self) -> dict[str, float]:
        """Return the setting liked best so far."""
        return self.study.values(self.study.best(self._space))

    def agreed(self) -> int:
        """Return how many of the answers agree with what is now thought of the person."""
        answers = self.study.answers
        if not answers:
            return 0
        space, study = self._space, self.study
        return agreement(surrogate_of(space, np.array(study.settings), answers), answers)

    def notes(self) -> list[str]:
        """Return lines that say where the best setting comes from."""
        study = self.study
        done = len(study.replies)
        return [
            f"surefoot personalise: liked best in {done} comparisons along {', '.join(study.axes)}; "
            f"{self.agreed()} of the {done} answers agree with it",
        ]

    def fragment(self) -> str:
        """Return the best setting as TOML."""
        return fragment_text(self._config, self.best(), self.notes())

    def plain(self) -> dict[str, Any]:
        """Return everything a script may want to know."""
        study = self.study
        return {
            "folder": self.folder,
            "answered": len(study.replies),
            "comparisons": study.comparisons,
            "over": study.over,
            "question": {
                name: {"file": self.file(name), "admittance": values} for name, values in self.question().items()
            },
            "best": self.best(),
            "agreeing_answers": self.agreed(),
            "bounds": {side.key: [side.low, side.high] for side in study.parameters},
            "result": self.folder / RESULT if study.over else None,
        }

    def _keep(self, study: Study) -> None:
        """Write the study, then what follows from it."""
        save(study, self.folder / FILE)
        self.study = study
        for name, values in self.question().items():
            note = [f"surefoot personalise: setting {name} of comparison {len(study.replies) + 1}"]
            write_text(self.file(name), setting_text(self._config, values, note), "--out")
        if study.over:
            write_text(self.folder / RESULT, setting_text(self._config, self.best(), self.notes()), "--out")
        for path in [self.folder / RESULT] if not study.over else [self.file("a"), self.file("b")]:
            path.unlink(missing_ok=True)  # of an earlier moment


def _known(axes: tuple[str, ...]) -> tuple[str, ...]:
    for axis in axes:
        if axis not in AXES:
            raise StudyError(f"--axes {axis}: no such axis; known: {', '.join(AXES)}")
    if len(set(axes)) != len(axes) or not axes:
        raise StudyError(f"--axes {','.join(axes)}: expected each of {', '.join(AXES)} at most once, and one at least")
    return axes
