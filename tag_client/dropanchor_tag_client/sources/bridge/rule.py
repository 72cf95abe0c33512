"""One rule of a file: what it makes of a payload."""

from collections.abc import Iterator, Mapping
from typing import Any, NamedTuple

from dropanchor_tag_client.sources.bridge.measurement import Drop, Dropped, Found, Measurement
from dropanchor_tag_client.sources.bridge.places import Element, UnusableError, at
from dropanchor_tag_client.sources.bridge.topics import wildcards_in
from dropanchor_tag_client.sources.bridge.values import Reader

Source = str | list[str]


class Rule(NamedTuple):
    """One table `[[rule]]`. each: paths of lists, empty without. factors: by field, what a value is multiplied with."""

    topic: str
    tag: str
    kind: str
    fields: Mapping[str, Source]
    each: tuple[str, ...]
    factors: Mapping[str, float]
    reader: Reader
    retained: bool

    def parse(self, topic: str, payload: Any, t_ns: int) -> Iterator[Found]:
        """Yield the measurements in a payload. t_ns: their time where the rule names none."""
        whole = Element(topic, wildcards_in(self.topic, topic), payload, payload)
        try:
            elements = self._elements(whole)
        except UnusableError as error:
            yield Dropped(Drop.NOT_UNDERSTOOD, f"{topic}: {error}")
            return
        for element in elements:
            try:
                yield Measurement(element.text(self.tag), self.kind, self._values(element, t_ns))
            except UnusableError as error:
                yield Dropped(Drop.NOT_UNDERSTOOD, f"{topic}: {error}")

    def _elements(self, whole: Element) -> list[Element]:
        if not self.each:
            return [whole]
        found = [at(whole.payload, path) for path in self.each]
        if len(found) == 1 and isinstance(found[0], dict):
            return [whole._replace(part=part, key=key) for key, part in found[0].items()]
        for path, one in zip(self.each, found, strict=True):
            if not isinstance(one, list):
                raise UnusableError(f"the payload has no list {path}")
            if len(one) != len(found[0]):
                raise UnusableError(f"{self.each[0]} has {len(found[0])} elements and {path} has {len(one)}")
        rows = zip(*found, strict=True)
        parts = found[0] if len(found) == 1 else [dict(zip(self.each, row, strict=True)) for row in rows]
        return [whole._replace(part=part, key=str(index)) for index, part in enumerate(parts)]

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
