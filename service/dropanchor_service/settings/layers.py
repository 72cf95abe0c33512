"""Which value of a setting is in force, where it comes from, and what it hides: for the command and the page."""

from collections.abc import Iterator, Mapping, Sequence
from typing import Any, NamedTuple

from pydantic import BaseModel, TypeAdapter

from dropanchor_schemas.settings_values import HeldValue, SettingSource, SettingValue

Path = tuple[str, ...]
_JSON = TypeAdapter(Any)


class Layer(NamedTuple):
    """One source of settings, with its values as nested tables. file: its name. table: where the values stand."""

    source: SettingSource
    values: Mapping[str, Any]
    file: str | None = None
    table: Path = ()

    @property
    def name(self) -> str:
        """Where the values are from, as messages say it."""
        return self.file or f"the {self.source.replace('_', ' ')}"

    def below(self, *path: str) -> "Layer":
        """Return the layer with the values of one table."""
        return self._replace(values=value_at(self.values, path) or {}, table=(*self.table, *path))


def value_at(table: Any, path: Sequence[str]) -> Any:
    """Return what stands there; None if nothing does."""
    for name in path:
        table = table.get(name) if isinstance(table, Mapping) else None
    return table


def held_in(layers: Sequence[Layer], *paths: Path) -> list[HeldValue]:
    """Return each value that the layers hold, the one in force first. layers: in ascending priority; paths: in
    descending one, which counts first."""
    return [
        HeldValue(source=layer.source, file=layer.file, at=[*layer.table, *path], value=as_json(found))
        for path in paths
        for layer in reversed(layers)
        if (found := value_at(layer.values, path)) is not None
    ]


def setting(
    path: Path, value: Any, held: Sequence[HeldValue], default: Any = None, above: SettingSource | None = None
) -> SettingValue:
    """Return a value with its source. held: what the configuration holds. above: a source that wins over it."""
    hides = [*held, HeldValue(source="default", at=[], file=None, value=as_json(default))]
    if above is None:
        first, *hides = hides
    else:
        first = HeldValue(source=above, at=[], file=None, value=None)
    return SettingValue(path=list(path), hides=hides, **(first.model_dump() | {"value": as_json(value)}))


def fields_of(model: BaseModel, layers: Sequence[Layer], path: Path, *otherwise: Path) -> Iterator[SettingValue]:
    """Yield the fields of a table. otherwise: where to look for those that the table at `path` does not hold."""
    for name, field in type(model).model_fields.items():
        held = held_in(layers, *((*table, name) for table in (path, *otherwise)))
        yield setting((*path, name), getattr(model, name), held, field.default)


def service_settings(
    settings: BaseModel, layers: Sequence[Layer], without: Sequence[str], path: Path = ()
) -> Iterator[SettingValue]:
    """Yield all settings but for those in the tables `without`, section by section."""
    for name, field in type(settings).model_fields.items():
        value = getattr(settings, name)
        if name in without:
            continue
        if isinstance(value, BaseModel) and isinstance(field.default, BaseModel):
            yield from service_settings(value, layers, (), (*path, name))
        else:
            yield setting((*path, name), value, held_in(layers, (*path, name)), field.default)


def as_json(value: Any) -> Any:
    return _JSON.dump_python(value, mode="json")
