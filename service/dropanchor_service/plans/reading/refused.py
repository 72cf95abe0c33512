"""Why a file cannot be a floor plan."""


class RefusedError(Exception):
    """The file cannot be used. The message says why, and what to do, in a sentence."""

    def __init__(self, reason: str) -> None:
        """reason: a sentence without its capital and its full stop."""
        super().__init__(f"{reason[:1].upper()}{reason[1:]}.")
