"""What a study found, in words: the same ones on the terminal, in the report and in the file that it writes."""

from __future__ import annotations

from math import isfinite

from bridge.config.intervention import InterventionConfig
from controller.tuning.confidence import Interval
from controller.tuning.recommend import Answer, Judged
from controller.tuning.score import Intervening, Outcome
from controller.tuning.space import Setting


def setting_words(setting: Setting) -> str:
    """Return what differs from the present values, such as 'probability_full 0.9'."""
    return ", ".join(f"{key} {value:g}" for key, value in setting.items()) or "present values"


def change_words(setting: Setting, present: InterventionConfig) -> str:
    """Return the same with what it was, such as 'probability_full 0.9 (now 0.8)'."""
    words = [f"{key} {value:g} (now {getattr(present, key):g})" for key, value in setting.items()]
    return ", ".join(words) or "the present values"


def number(value: float, digits: int = 2) -> str:
    """Return a number, or a dash for none."""
    return f"{value:.{digits}f}" if isfinite(value) else "–"


def outcome_words(outcome: Outcome) -> str:
    """Return counts as one sentence without its end."""
    parts = []
    if outcome.falls:
        parts.append(f"{outcome.caught} of {outcome.falls} falls caught, median lead {number(outcome.lead_median_s)} s")
    parts.append(f"{outcome.needless} needless in {outcome.hours:.2f} h")
    return ", ".join(parts)


def intervening_words(by: Intervening) -> str:
    """Return what counts as an intervention."""
    return "ARREST" if by is Intervening.ARREST else "GUARD or ARREST"


def findings(answer: Answer) -> list[str]:
    """Return what the study found, a sentence a line."""
    best, present, question = answer.recommended, answer.present, answer.question
    lines = [f"Recommended: {change_words(best.setting, present.config)}."]
    lines.append(f"On all recordings: {outcome_words(best.outcome)}.{_spread(answer)}")
    if answer.held_out is not None:
        lines.append(
            f"On recordings that had no say in the choice ({len(answer.folds)} parts, each chosen for without it): "
            f"{outcome_words(answer.held_out)}. Present values on the same: {outcome_words(present.outcome)}."
        )
    else:
        lines.append("Nothing could be held out: with one recording these counts flatter the choice.")
    lines.append(verdict(answer))
    if advice := _advice(answer):
        lines.append(advice)
    if question.by is Intervening.GUARD:
        lines.append("An intervention is GUARD or ARREST here.")
    return lines


def verdict(answer: Answer) -> str:
    """Return what the recordings can say about the budget."""
    budget, judged, needless = answer.question.budget_per_hour, answer.judged, answer.needless
    asked = f"Budget of {budget:g} needless an hour"
    if judged.hours <= 0.0:
        return f"{asked}: no time without falls was recorded, nothing can be said about it."
    seen = f"{judged.needless} in {judged.hours:.2f} h, {_rate(needless)} an hour"
    if answer.supported:
        return f"{asked}: kept, with 95 % confidence ({seen}, at most {answer.bound_per_hour:.2g})."
    if needless.low > budget:
        return f"{asked}: exceeded ({seen}). No setting that was tried keeps it here." if not answer.within else (
            f"{asked}: exceeded on recordings that had no say ({seen})."
        )  # fmt: skip
    return (
        f"{asked}: these recordings cannot show it ({seen}). That takes {answer.hours_needed:.0f} h without falls and "
        f"without a needless intervention (rule of three); {judged.hours:.2f} h were recorded."
    )


def notes(answer: Answer) -> list[str]:
    """Return what anybody who reads the numbers must know beside them."""
    lines = [
        "A replay is not a trial: person and walker do not react to the changed controller. What it says holds up to "
        "the first intervention that the recording did not have."
    ]
    unlabelled = [case.name for case in answer.cases if not case.labelled]
    if unlabelled:
        lines.append(
            f"Nobody said whether there are falls in {len(unlabelled)} of {len(answer.cases)} recordings "
            f"({unlabelled[0]}{', ...' if unlabelled[1:] else ''}): taken as without. See --falls."
        )
    if answer.present.outcome.unwatched:
        lines.append(
            f"The system was not armed before {answer.present.outcome.unwatched} of the falls; they count as missed."
        )
    if not answer.present.outcome.falls:
        lines.append("There is no fall in these recordings: only needless interventions were tuned.")
    return lines


def _advice(answer: Answer) -> str:
    """Say when nothing is gained by changing."""
    if not answer.recommended.setting:
        return "Nothing that was tried does better than the present values: keep them."
    new, old = answer.judged, answer.present.outcome
    longer = nan_is_0(new.lead_median_s) > nan_is_0(old.lead_median_s)
    if new.caught <= old.caught and new.needless >= old.needless and not longer:
        return "On recordings that had no say the choice did no better than the present values: keep them."
    return ""


def nan_is_0(value: float) -> float:
    """Return a number, 0 for none: a lead that there is not is none to speak of."""
    return value if isfinite(value) else 0.0


def _spread(answer: Answer) -> str:
    if not answer.recommended.outcome.falls:
        return ""
    share, lead = answer.caught, answer.resampled.lead_median_s
    return (
        f" 95 % intervals: {100 * share.low:.0f} to {100 * share.high:.0f} % of falls caught, "
        f"lead {number(lead.low)} to {number(lead.high)} s."
    )


def _rate(rate: Interval) -> str:
    return f"{rate.value:.2g} ({rate.low:.2g} to {rate.high:.2g})" if isfinite(rate.value) else "–"


def rows(answer: Answer, most: int = 12) -> list[tuple[str, Judged]]:
    """Return what a table of the trade-off shows: the present values, the front, thinned where it is long.

    Each row has its mark: 'present', 'recommended', or ''.
    """
    front, best = list(answer.front), answer.recommended
    if len(front) > most:
        step = (len(front) - 1) / (most - 1)
        kept = {round(step * place) for place in range(most)}
        front = [judged for place, judged in enumerate(front) if place in kept or judged.setting == best.setting]
    if all(judged.setting != best.setting for judged in front):
        front.append(best)
    shown = [judged for judged in front if judged.setting]
    marked = [("recommended" if judged.setting == best.setting else "", judged) for judged in shown]
    mark = "present, recommended" if not best.setting else "present"
    return [(mark, answer.present), *marked]
