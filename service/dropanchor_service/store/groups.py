"""Which tag is in which group."""

from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass, field

from dropanchor_schemas.site import TagSettings


@dataclass(frozen=True)
class Groups:
    """The groups of the tags, as their settings name them. Two are equal if no tag has changed its group.

    by_tag: the group of each tag with settings of its own. default: the group of all others.
    """

    by_tag: Mapping[str, str] = field(default_factory=dict)
    default: str = ""

    def are_in(self, tags: Sequence[str], groups: Collection[str]) -> list[bool]:
        """Return whether the group of each tag is one of these."""
        return [self.by_tag.get(tag, self.default) in groups for tag in tags]


def groups_of(tags: Mapping[str, TagSettings], default: TagSettings) -> Groups:
    """Return the groups that these settings name. default: of the tags without settings of their own."""
    return Groups({tag: settings.group for tag, settings in tags.items()}, default.group)
