"""What all open pages share: the recordings, the file, the study's candidates. No page in it: values in, values out."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Final

from bridge.config.intervention import InterventionConfig
from bridge.config.load import load_config
from bridge.config.surefoot import SurefootConfig
from bridge.errors import SurefootError
from controller.tuning.cases import Case
from controller.tuning.course import Stages
from controller.tuning.page.draft import Draft
from controller.tuning.replay import Run, replay
from controller.tuning.save import write_toml
from controller.tuning.score import Intervening, Outcome, Tally, score_one, total

NOTE: Final = "set on the page of `surefoot tune --serve`"
REMEMBERED: Final = 64  # settings whose scores are kept: going back to one is immediate


@dataclass(frozen=True, slots=True)
class Candidate:
    """A setting that a study tried."""

    values: dict[str, float]  # keys of [intervention]
    outcome: Outcome
    recommended: bool = False


@dataclass(frozen=True, slots=True)
class Scores:
    """What a setting does to all recordings."""

    outcome: Outcome
    tallies: dict[str, Tally]  # by the name of the recording


@dataclass(slots=True)
class Bench:
    """The shared state of the served pages."""

    cases: Sequence[Case]
    config: SurefootConfig  # as it stands in the file
    file: Path | None = None  # where it was read; from the first saving on, where it was saved
    save_to: Path | None = None
    overrides: Sequence[str] = ()  # `--set` of the command line, on top of the file
    force: bool = False  # overwrite what is at `save_to` though it is not `file`
    candidates: Sequence[Candidate] = ()
    by: Intervening = Intervening.ARREST
    budget_per_h: float | None = None
    _scores: dict[InterventionConfig, Scores] = field(default_factory=dict)

    def run(self, case: Case, intervention: InterventionConfig) -> Run:
        """Return what `intervention` would have done in `case`."""
        mpc = self.config.mpc
        return replay(case, intervention, self.config.supervisor, Stages(mpc.stages, mpc.stage_s))

    def score(
        self, intervention: InterventionConfig, told: Callable[[int], None], unwanted: Callable[[], bool]
    ) -> Scores | None:
        """Return what `intervention` would have done in all recordings; None once it is `unwanted`.

        Args:
            intervention: the thresholds.
            told: is called with the number of recordings that are done.
            unwanted: is asked between two recordings.
        """
        known = self._scores.get(intervention)
        if known is not None:
            return known
        tallies: dict[str, Tally] = {}
        for done, case in enumerate(self.cases):
            if unwanted():
                return None
            told(done)
            tallies[case.name] = score_one(self.run(case, intervention), self.by)
        scores = Scores(total(list(tallies.values())), tallies)
        while len(self._scores) >= REMEMBERED:
            self._scores.pop(next(iter(self._scores)), None)
        self._scores[intervention] = scores
        return scores

    def save(self, draft: Draft) -> str:
        """Write the thresholds of `draft` into the file and return what was done, in words.

        Raises:
            SurefootError: they do not hold together, the file was changed by others meanwhile, or cannot be written;
                nothing was written.
        """
        if self.save_to is None:
            raise SurefootError("nowhere to save: start with --config FILE or --out FILE")
        intervention, refusal = draft.check()
        if intervention is None:
            raise SurefootError(refusal)
        changes = {key: getattr(intervention, key) for key in draft.changed}
        if not changes:
            return f"{self.save_to}: nothing to save, it says just this"
        if self.read().intervention != draft.base.intervention:
            raise SurefootError(f"{self.file} was changed since this page read it: reload the page")
        own = self.file is not None and self.file.resolve() == self.save_to.resolve()
        write_toml(self.file, self.save_to, changes, note=(NOTE,), force=self.force or own)
        self.file = self.save_to
        self.refresh()
        return f"saved to {self.save_to}: {', '.join(changes)}"

    def refresh(self) -> None:
        """Take the configuration as it stands in the file now; scores under another `[supervisor]` are forgotten.

        Raises:
            ConfigError: the file is gone or does not hold together; what was known stays.
        """
        found = self.read()
        if found.model_copy(update={"intervention": self.config.intervention}) != self.config:
            self._scores.clear()
        self.config = found

    def read(self) -> SurefootConfig:
        """Return the configuration as it stands in the file now.

        Raises:
            ConfigError: the file is gone or does not hold together.
        """
        return self.config if self.file is None else load_config(self.file, self.overrides)
