"""Everything that can go wrong, by kind.

A message says what is wrong, where, what was wanted, what was found, and what to do about it.
"""


class CasysidError(Exception):
    """Base of every error that casysid raises on purpose."""


class RobotError(CasysidError, ValueError):
    """A robot description cannot be used."""


class RecordingError(CasysidError, ValueError):
    """A recording cannot be used."""


class ParameterError(CasysidError, ValueError):
    """A setting or a parameter vector is outside what makes sense."""


class OutputError(CasysidError):
    """Files cannot be written where they were asked for."""


class SolverError(CasysidError):
    """A numerical solver ended without a usable solution."""


class MissingExtraError(CasysidError, ImportError):
    """An optional package is needed for what was asked."""


class CasysidWarning(UserWarning):
    """The answer stands, but something about it is weak."""
