"""Errors of the suite: each is one clear line for a person, and carries the exit code of the command line."""


class AppoccError(Exception):
    """Bad input or wrong usage; the message is one line that names the place and the reason."""

    exit_code = 2


class ShapeError(AppoccError, ValueError):
    """An array has another shape, type or range than its dataclass promises."""


class DataError(AppoccError, ValueError):
    """A file or folder is missing, damaged, or says something that cannot be true."""


class NotFoundError(AppoccError, LookupError):
    """A name that was asked for (scene, sample, channel, table) is not in the dataset."""
