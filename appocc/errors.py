"""Errors of the package: each has a message of one line and an exit code for the command line."""

_SHOWN_CHARACTERS = 80


def shown(value: object) -> str:
    """Return a wrong value as an error message shows it: one line of limited length, `nothing` for None."""
    if value is None:
        return "nothing"
    text = " ".join(repr(value).split())
    return text if len(text) <= _SHOWN_CHARACTERS else f"{text[:_SHOWN_CHARACTERS]}..."


class AppoccError(Exception):
    """Invalid input or usage; the message is one line with the location and the reason."""

    exit_code = 2


class ShapeError(AppoccError, ValueError):
    """An array or number has an invalid shape, type or range."""


class DataError(AppoccError, ValueError):
    """A file or folder is missing, damaged or invalid."""


class NotFoundError(AppoccError, LookupError):
    """A requested name (scene, sample, channel, table, ...) does not exist."""


class ItemsFailedError(AppoccError):
    """Some items of a long run failed, and the others are done."""

    exit_code = 1
