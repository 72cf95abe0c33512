"""Why a file cannot be a floor plan."""

from dropanchor_schemas.sentences import Sentence


class RefusedError(Exception):
    """The file cannot be used. The message says why, and what to do, in a sentence."""

    def __init__(self, reason: str) -> None:
        """reason: a sentence without its capital and its full stop."""
        text = f"{reason[:1].upper()}{reason[1:]}."
        super().__init__(Sentence(text, reason.code, reason.values) if isinstance(reason, Sentence) else text)
