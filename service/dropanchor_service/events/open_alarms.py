"""The alarms of one site that are not over: on which flags of which states they hang."""

from collections.abc import Mapping

from dropanchor_schemas.zones import EventRule, Severity, Zone
from dropanchor_service.events.describe import severities
from dropanchor_service.events.drafts import AlarmBegan, AlarmsOver, StateKey
from dropanchor_service.zones.items import ZoneItems

ANY = ~0  # flag of a state


class OpenAlarms:
    def __init__(self, items: ZoneItems, stored: Mapping[StateKey, int]) -> None:
        self._items = items
        self._flags = dict(stored)

    def begin(self, alarm: AlarmBegan) -> None:
        self._flags[alarm.key] = self._flags.get(alarm.key, 0) | alarm.flag

    def end(self, key: StateKey, lost: int, t_ns: int) -> AlarmsOver | None:
        """Forget the alarms that hang on flags that a state has lost. Return them, if there are any."""
        flags = self._flags.get(key, 0)
        if flags & lost == 0:
            return None
        if flags & ~lost:
            self._flags[key] = flags & ~lost
        else:
            del self._flags[key]
        item = self._item(key)
        return AlarmsOver(key, flags & lost, t_ns, item is not None and item.is_muted_at(t_ns))

    def lowered(self) -> Mapping[StateKey, int]:
        """Return the flags that make no alarms any longer, of the states on which any hang."""
        return {
            key: sum(flag for flag, made in severities(item).items() if made is Severity.EVENT)
            for key in self._flags
            if (item := self._item(key)) is not None
        }

    def _item(self, key: StateKey) -> Zone | EventRule | None:
        return self._items.zones.all.get(key.item) if key.source == "zone" else self._items.rules.all.get(key.item)
