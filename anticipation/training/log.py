"""TensorBoard: loss and learning rate of every fit of a run."""

from __future__ import annotations

import importlib.util
from pathlib import Path
from typing import Any

from bridge.errors import MissingExtraError


def available() -> bool:
    """Tell whether TensorBoard is installed."""
    return importlib.util.find_spec("tensorboard") is not None


class Log:
    """Event files under a folder, one subfolder for each fit.

    A resumed fit writes on from its epoch; TensorBoard drops what an earlier process wrote beyond it.
    """

    def __init__(self, folder: Path) -> None:
        """Prepare to write.

        Raises:
            MissingExtraError: TensorBoard is not installed.
        """
        if not available():
            raise MissingExtraError("the log", "tensorboard", "train")
        self._folder = folder
        self._writer: Any = None
        self._fit = ""

    def note(self, fit: str, epoch: int, loss: float, rate: float) -> None:
        """Note the mean loss and the learning rate of an epoch, counted from 0."""
        if fit != self._fit:
            from torch.utils.tensorboard import SummaryWriter  # noqa: PLC0415 (slow, and an extra)

            self.close()
            name = fit.replace(":", "").replace(" ", "-")
            self._writer = SummaryWriter(str(self._folder / name), purge_step=epoch)
            self._fit = fit
        self._writer.add_scalar("loss", loss, epoch)
        self._writer.add_scalar("learning rate", rate, epoch)
        self._writer.flush()

    def close(self) -> None:
        """Close the event file."""
        if self._writer is not None:
            self._writer.close()
            self._writer, self._fit = None, ""
