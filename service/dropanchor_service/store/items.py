"""Named items that are edited over REST, such as zones: kept in memory and saved in a file."""

from collections.abc import Callable, Mapping
from functools import partial
from pathlib import Path
from threading import Lock
from typing import Any, Generic, TypeVar

from pydantic import BaseModel, TypeAdapter

from dropanchor_service.runtime.atomic_file import UP_TO_UMASK
from dropanchor_service.runtime.recovery import Recovery, write_with_copy
from dropanchor_service.store.preconditions import Precondition, always, require
from dropanchor_service.store.shared import Save
from dropanchor_service.store.trail import NO_TRAIL, Change, Trail

Item = TypeVar("Item", bound=BaseModel)

PRIVATE = 0o600


class FullError(Exception):
    """There are as many items as allowed."""


class NamedItems(Generic[Item]):
    """Items by id. Any thread may use it. `version` grows with every change."""

    def __init__(
        self,
        adapter: TypeAdapter[dict[str, Item]],
        path: Path | None,
        limit: int,
        mode: int = UP_TO_UMASK,
        recovery: Recovery | None = None,
    ) -> None:
        """Load the file if it exists.

        path: where changes are saved; None: nowhere. limit: most items. mode: the permissions of the file. recovery:
        reports a file that is damaged. Raises NewerFileError.
        """
        self._adapter = adapter
        self._save: Save | None = None
        if path is not None:
            self._save = lambda content: write_with_copy(path, content, mode)
        self._limit = limit
        self._lock = Lock()
        self._items: dict[str, Item] = {}
        if path is not None:
            self._items = (recovery or Recovery()).read(path, adapter.validate_json, mode) or {}
        self.on_change: list[Callable[[], None]] = []  # called after every change, on the thread that makes it
        self._noted: Callable[[str, Item | None, Item | None], Change] = partial(Change, "item")
        self.trail: Trail = NO_TRAIL
        self.version = 1

    def note_changes(self, trail: Trail, kind: str, shown: Callable[[Item], BaseModel] = lambda item: item) -> None:
        """Note each change in a trail. shown: returns what of an item may be read there."""
        self.trail = trail
        self._noted = partial(Change, kind, shown=shown)

    def share(self, saved: bytes | None, save: Save) -> None:
        """Go on from what another process has saved; see `Shared`."""
        self._save = save
        if saved is not None:
            self._apply(self._adapter.validate_json(saved))
        elif self._items:
            self._save_all(self._items)

    @property
    def all(self) -> Mapping[str, Item]:
        """The items by id, in the order in which they were made. The mapping never changes."""
        return self._items

    def put(self, name: str, item: Item, allows: Precondition = always) -> None:
        """Add or replace an item and save.

        Raises FullError, OSError, and ChangedMeanwhileError when `allows` refuses; then nothing has changed.
        """
        with self._lock:
            before = self._items.get(name)
            require(allows, before)
            if name not in self._items and len(self._items) >= self._limit:
                raise FullError
            self._replace(self._items | {name: item}, self._noted(name, before, item))

    def remove(self, name: str, allows: Precondition = always) -> None:
        """Remove an item and save.

        Raises KeyError when there is none, OSError, and ChangedMeanwhileError when `allows` refuses; then nothing has
        changed.
        """
        with self._lock:
            before = self._items[name]
            require(allows, before)
            left = {key: item for key, item in self._items.items() if key != name}
            self._replace(left, self._noted(name, before, None))

    def _replace(self, items: dict[str, Item], change: Change) -> None:
        """Note and save first, then apply: a restart never loses an acknowledged change."""
        with self.trail.changing(change):
            self._save_all(items)
        self._apply(items)

    def _save_all(self, items: dict[str, Item]) -> None:
        if self._save is not None:
            self._save(self._adapter.dump_json(items, indent=2))

    def _apply(self, items: dict[str, Item]) -> None:
        self._items = items
        self.version += 1
        for told in self.on_change:
            told()


def adapter_of(model: Any) -> TypeAdapter[dict[str, Any]]:
    """Return the adapter of a file with items of this model."""
    return TypeAdapter(dict[str, model])
