"""Why the history cannot be read or written."""


class HistoryError(OSError):
    """The history cannot be read or written. The message is for the operator."""


class UnfinishedSummaryError(HistoryError):
    """The period cannot be read in a short time yet."""


class TooMuchError(ValueError):
    """The period is too long for so many tags."""
