"""What a row of the engine was made with."""

from typing import NamedTuple

from dropanchor_schemas.site import StartPose, TagSettings
from dropanchor_service.estimation.columns import Array
from dropanchor_service.settings.engine_columns import tag_columns


class Configured(NamedTuple):
    """The settings of a tag and of its site."""

    tag: TagSettings
    declination_rad: float
    declination_std_rad: float | None

    def with_start(self, start: StartPose | None) -> "Configured":
        """Return the settings with another start of the tag."""
        return self._replace(tag=self.tag.model_copy(update={"start": start}))

    def columns(self) -> Array:
        """Return TAG_SETTINGS (0-d)."""
        return tag_columns(*self)

    def matters_after(self, before: "Configured") -> bool:
        """Return whether the change from `before` matters to the engine. A name, a colour and a group do not."""
        return self != before and self.columns().tobytes() != before.columns().tobytes()

    def is_turned_from(self, before: "Configured") -> bool:
        """Return whether the declination and its error are all that matters in the change from `before`."""
        return self.matters_after(before) and not self.matters_after(
            before._replace(declination_rad=self.declination_rad, declination_std_rad=self.declination_std_rad)
        )
