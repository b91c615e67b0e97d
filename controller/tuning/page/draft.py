"""The values on the page: what was typed or dragged, checked by the config itself."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any, Final, NamedTuple

from bridge.config.intervention import InterventionConfig
from bridge.config.load import parse_config
from bridge.config.surefoot import SurefootConfig
from bridge.errors import ConfigError
from controller.tuning.page.knobs import KNOBS

PAGE: Final = "page"
Entered = float | None  # a number field that was emptied holds None


class Draft(NamedTuple):
    """The thresholds as they stand on one page, valid or not."""

    base: SurefootConfig  # the file as it was read, for everything else in it
    values: Mapping[str, Entered]

    @classmethod
    def of(cls, config: SurefootConfig) -> Draft:
        """Return the draft that changes nothing in `config`."""
        return cls(config, {key: getattr(config.intervention, key) for key in KNOBS})

    def change(self, **values: Entered) -> Draft:
        """Return the draft with other values under these keys."""
        return self._replace(values={**self.values, **values})

    def check(self) -> tuple[InterventionConfig | None, str]:
        """Return the thresholds, or None and the config's own words for what is wrong with them."""
        table: dict[str, Any] = self.base.model_dump()
        table["intervention"] = dict(self.values)
        try:
            return parse_config(table, PAGE).intervention, ""
        except ConfigError as error:
            return None, str(error).removeprefix(f"{PAGE}: ")

    @property
    def changed(self) -> dict[str, tuple[Entered, Entered]]:
        """Return the keys whose value is not the file's, each with the file's value and the new one."""
        file = self.base.intervention
        return {key: (getattr(file, key), new) for key, new in self.values.items() if new != getattr(file, key)}
