"""Models of the values of settings that are in force, where they come from, and what they hide."""

from typing import Any, Literal

from pydantic import Field

from dropanchor_schemas.models import Frozen

SettingSource = Literal["rest", "command_line", "environment", "file", "first_range", "default"]


class HeldValue(Frozen):
    """A value that one source has."""

    source: SettingSource = Field(
        description="rest: set over REST or on the page; file: the settings file; first_range: the anchor of the first "
        "range. In this order, the first one that has a value wins."
    )
    file: str | None = Field(description="The name of the settings file.")
    at: list[str] = Field(
        description="The tables and the key that hold it in the file, the environment or the command line, such as "
        "`tag_defaults`, `height_m`."
    )
    value: Any = Field(description="The value; null: not set, or removed.")


class SettingValue(HeldValue):
    """A value that is in force."""

    path: list[str] = Field(
        description="The setting: its tables and its key, such as `tags`, `forklift-7`, `height_m`. An anchor is one "
        "value, with its id in place of the key."
    )
    hides: list[HeldValue] = Field(
        description="What would be in force without it, and then without that, down to the default. The first one, put "
        "over REST, gives the value back to its source."
    )


class SettingValueList(Frozen):
    """total: how many there are, beyond the limit, too."""

    values: list[SettingValue]
    total: int = Field(description="How many values there are, also beyond `limit`.")
