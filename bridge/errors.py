"""The error a user sees: one line naming the thing, the value and the limit."""

from bridge.exit_codes import ExitCode


class SurefootError(Exception):
    """A bad input or an environment that cannot serve; the CLI prints it on one line and exits with code 2."""

    exit_code = ExitCode.BAD_INPUT


class ConfigError(SurefootError):
    """A configuration file that is missing, malformed, or has an unknown key or a value out of range."""


class SourceError(SurefootError):
    """A camera, video, recording or keypoint file that cannot be opened or read."""


class CheckpointError(SurefootError):
    """A network checkpoint that is missing, damaged or of another version."""


class MissingExtraError(SurefootError):
    """An optional dependency that is not installed."""

    def __init__(self, what: str, package: str, extra: str) -> None:
        super().__init__(f"{what} needs the package '{package}': pip install 'surefoot[{extra}]'")


class TransportError(SurefootError):
    """An endpoint that cannot be opened: port in use, malformed address, no permission."""


class InvalidMessage(ValueError):  # noqa: N818 (it describes the message, not a failure here)
    """A message that must not be acted on; the text names the field, the value and the limit."""
