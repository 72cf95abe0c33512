"""Which tags get a row."""

from dropanchor_schemas.keys import InvalidKeyError, tag_from_key
from dropanchor_schemas.wire import Reason
from dropanchor_service.settings import Settings
from dropanchor_service.store import SiteStore, Tag, TagTable


class Admission:
    """Tags that an operator has listed always; others as they are heard, if the settings say so, up to `max_tags`."""

    def __init__(self, settings: Settings, site: SiteStore, tags: TagTable) -> None:
        self._accepts_unknown = settings.unknown_tags == "accept"
        self._max_tags = settings.max_tags
        self._site = site
        self._tags = tags

    def by_key(self, key: str) -> Tag | Reason:
        """The tag that a key names, registered when it is new, or why it is not."""
        try:
            name = tag_from_key(key)
        except InvalidKeyError:
            return Reason.KEY_INVALID
        return self.by_name(name)

    def by_name(self, name: str) -> Tag | Reason:
        tag = self._tags.find(name)
        if tag is not None:
            return tag
        if name in self._site.tags:
            return self._tags.register(name)
        if not self._accepts_unknown:
            return Reason.TAG_UNKNOWN
        if len(self._tags) >= self._max_tags:
            return Reason.TAGS_FULL
        return self._tags.register(name)

    def register_listed(self) -> None:
        """A row for every tag that the operator has listed."""
        for name in self._site.tags:
            self._tags.register(name)
