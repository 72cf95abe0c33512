"""Ids of tags and sites as the keys of tables."""

from typing import Annotated

from pydantic import AfterValidator

from dropanchor_schemas.file_names import file_name_of
from dropanchor_schemas.keys import chunk_from_id, refuse_pattern


def _is_id(name: str) -> str:
    chunk_from_id(name)
    refuse_pattern(name)
    return name


def _names_files(site: str) -> str:
    file_name_of(site)
    return site


SettingsId = Annotated[str, AfterValidator(_is_id)]
SiteId = Annotated[SettingsId, AfterValidator(_names_files)]
"""The id of a site, of which files and folders get their names."""
