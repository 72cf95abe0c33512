"""One rule of a file: what it makes of a payload."""

from collections.abc import Iterator, Mapping
from typing import Any, NamedTuple

from dropanchor_tag_client.sources.bridge.measurement import Drop, Dropped, Found, Measurement
from dropanchor_tag_client.sources.bridge.places import Element, UnusableError, at
from dropanchor_tag_client.sources.bridge.topics import wildcards_in
from dropanchor_tag_client.sources.bridge.values import Reader
from dropanchor_tag_client.sources.modules.device_clock import DeviceClock

Source = str | list[str]
_MAX_CLOCKS = 10_000


class Rule(NamedTuple):
    """One table `[[rule]]`. each: paths of lists, empty without. factors: by field, what a value is multiplied with.
    clocks: by tag, where the times count from the start of the device; None where they are UTC."""

    topic: str
    tag: str
    kind: str
    fields: Mapping[str, Source]
    each: tuple[str, ...]
    factors: Mapping[str, float]
    reader: Reader
    retained: bool
    clocks: dict[str, DeviceClock] | None = None

    def parse(self, topic: str, payload: Any, t_ns: int) -> Iterator[Found]:
        """Yield the measurements in a payload. t_ns: their time where the rule names none."""
        whole = Element(topic, wildcards_in(self.topic, topic), (payload,), payload)
        try:
            elements = self._elements(whole)
        except UnusableError as error:
            yield Dropped(Drop.NOT_UNDERSTOOD, f"{topic}: {error}")
            return
        found: list[Found] = []
        for element in elements:
            try:
                found.append(Measurement(self._tag(element), self.kind, self._values(element, t_ns)))
            except UnusableError as error:
                found.append(Dropped(Drop.NOT_UNDERSTOOD, f"{topic}: {error}"))
        yield from found if self.clocks is None else _in_utc(found, self.clocks, t_ns)

    def _tag(self, element: Element) -> str:
        if self.tag == "{key}" and element.is_index:
            raise UnusableError(f"{{key}} is {element.key}, a place in a list, which is no name of a tag")
        return element.text(self.tag)

    def _elements(self, whole: Element) -> list[Element]:
        if not self.each:
            return [whole]
        if len(self.each) == 1:
            return whole.elements(self.each[0])
        found = [at(whole.part, path) for path in self.each]
        for path, one in zip(self.each, found, strict=True):
            if not isinstance(one, list):
                raise UnusableError(f"the payload has no list {path}")
            if len(one) != len(found[0]):
                raise UnusableError(f"{self.each[0]} has {len(found[0])} elements and {path} has {len(one)}")
        parts = [dict(zip(self.each, row, strict=True)) for row in zip(*found, strict=True)]
        return [whole._replace(part=part, key=str(index), is_index=True) for index, part in enumerate(parts)]

    def _values(self, element: Element, t_ns: int) -> dict[str, Any]:
        return {"t_ns": t_ns} | {name: self._field(element, name, source) for name, source in self.fields.items()}

    def _field(self, element: Element, name: str, source: Source) -> Any:
        if isinstance(source, list):
            return [self._number(element.value(one), name, one) for one in source]
        if name == "anchor":
            return element.value(source)
        if name == "t_ns":
            return self.reader.time_ns(element.value_beside(source), source)
        value = element.value(source)
        if isinstance(value, list):
            return [self._number(one, name, source) for one in value]
        return self._number(value, name, source)

    def _number(self, value: Any, name: str, source: str) -> Any:
        return self.reader.scaled(value, self.factors.get(name), source)


def _in_utc(found: list[Found], clocks: dict[str, DeviceClock], arrival_ns: int) -> Iterator[Found]:
    """Yield the measurements with times of their devices in UTC: the newest of a tag is the one that just arrived."""
    newest: dict[str, int] = {}
    for one in found:
        if isinstance(one, Measurement):
            newest[one.tag] = max(newest.get(one.tag, 0), one.fields["t_ns"])
    offsets = {}
    for tag, device_ns in newest.items():
        if tag not in clocks and len(clocks) >= _MAX_CLOCKS:
            clocks.pop(next(iter(clocks)))
        offsets[tag] = clocks.setdefault(tag, DeviceClock()).utc_ns(arrival_ns, device_ns) - device_ns
    for one in found:
        if isinstance(one, Measurement):
            one.fields["t_ns"] += offsets[one.tag]
        yield one
