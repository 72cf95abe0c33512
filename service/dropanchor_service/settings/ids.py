"""Ids of tags and sites as the keys of tables."""

from typing import Annotated

from pydantic import AfterValidator

from dropanchor_schemas.keys import InvalidKeyError, chunk_from_id, refuse_pattern


def _is_id(name: str) -> str:
    try:
        chunk_from_id(name)
        refuse_pattern(name)
    except InvalidKeyError as error:
        raise ValueError(str(error)) from error
    return name


SettingsId = Annotated[str, AfterValidator(_is_id)]
