"""Models of OGC API – Features, Part 1 (OGC 17-069r4): landing page, conformance, collections and features."""

from typing import Any, Literal

from pydantic import BaseModel, ConfigDict, Field
from pydantic.alias_generators import to_camel


class _Answer(BaseModel):
    model_config = ConfigDict(frozen=True, alias_generator=to_camel)


class FeatureLink(_Answer):
    """Where something else of the interface is."""

    href: str
    rel: str
    type: str


class _Linked(_Answer):
    links: list[FeatureLink]


class FeaturesLandingPage(_Linked):
    """What a client asks first."""

    title: str
    description: str


class FeaturesConformance(_Answer):
    """What of the standard the service holds."""

    conforms_to: list[str]


class FeatureCollectionInfo(_Linked):
    """A collection of features."""

    id: str
    title: str
    description: str
    item_type: Literal["feature"]
    crs: list[str]


class FeatureCollectionList(_Linked):
    """All collections."""

    collections: list[FeatureCollectionInfo]


class FeatureItem(_Answer):
    """A feature of a collection."""

    type: Literal["Feature"]
    id: str
    geometry: dict[str, Any] | None = Field(description="WGS 84; null while nothing is known to be anywhere.")
    properties: dict[str, Any]


class FeatureItemAlone(FeatureItem, _Linked):
    """A feature that was asked for by its id."""


class FeaturePage(_Linked):
    """A page of the features of a collection."""

    type: Literal["FeatureCollection"]
    time_stamp: str = Field(description="When the page was made.")
    number_matched: int = Field(description="How many features the query selects.")
    number_returned: int
    features: list[FeatureItem]
