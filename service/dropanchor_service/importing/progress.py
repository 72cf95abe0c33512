"""A progress bar for work that takes long, only where standard error is a terminal."""

from collections.abc import Iterable, Iterator
from typing import TypeVar

from tqdm import tqdm

T = TypeVar("T")
_DELAY_S = 1.0


def shown(items: Iterable[T], what: str, total: int | None = None) -> Iterator[T]:
    """Yield the items. total: how many they are, if that is known."""
    yield from tqdm(items, desc=what, total=total or None, unit_scale=True, disable=None, leave=False, delay=_DELAY_S)
