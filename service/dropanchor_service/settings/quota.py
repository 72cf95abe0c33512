"""Which tags a site admits, and how many."""

from dataclasses import dataclass
from typing import Literal

UnknownTags = Literal["accept", "quarantine", "refuse"]


@dataclass(frozen=True)
class Quota:
    """unknown_tags: what to do with a tag that the site does not list. max_unconfirmed_tags: how many of these get a
    row with their first message. max_tags: how many tags get a row at all."""

    unknown_tags: UnknownTags = "accept"
    max_unconfirmed_tags: int = 200
    max_tags: int = 20_000
