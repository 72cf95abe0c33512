"""The floor plans of the site and their images: changed over REST, kept through a restart."""

from contextlib import suppress
from pathlib import Path
from threading import Lock

from dropanchor_schemas.plans import Plan, PlanImage
from dropanchor_service.plans.images import ImageFolder
from dropanchor_service.plans.reading.messages import ReadPlan
from dropanchor_service.runtime.recovery import Recovery, was_damaged
from dropanchor_service.store.items import NamedItems, adapter_of
from dropanchor_service.store.preconditions import Precondition, always
from dropanchor_service.store.trail import Change

MAX_PLANS = 64
MAX_UNUSED = 8
"""Images of no plan that are kept: just uploaded, or of a plan whose deletion may be undone."""


class ImageMissingError(Exception):
    """The image of a plan has not been uploaded, or is no longer there."""


class PlanStore(NamedItems[Plan]):
    """Any thread may use it. A plan is valid once `plans.json` is written; its image is on the disk before."""

    def __init__(self, folder: Path | None, recovery: Recovery | None = None) -> None:
        """Load what is in the data folder. None: keep everything in memory. recovery: reports what is damaged.

        Raises NewerFileError.
        """
        recovery = recovery or Recovery()
        path = None if folder is None else folder / "plans.json"
        super().__init__(adapter_of(Plan), path, MAX_PLANS, recovery=recovery)
        self._images_lock = Lock()
        self._folder = ImageFolder(None if folder is None else folder / "plans")
        self._images: dict[str, PlanImage] = {plan.image.id: plan.image for plan in self.all.values()}
        if path is None or not was_damaged(path):  # the plans that were in it still need their images
            self._folder.delete_others(self._images.values())
        self._folder.check(self._images.values(), recovery)

    def image(self, image: str) -> PlanImage | None:
        """Return the image with this id; None if it was not uploaded or is no longer kept."""
        return self._images.get(image)

    def content(self, image: PlanImage) -> bytes | None:
        """Return the file of an image; None if it is gone. Raises OSError."""
        return self._folder.read(image)

    def add_image(self, read: ReadPlan) -> PlanImage:
        """Store an image that a plan can then use. Raises OSError."""
        made = read.description
        with self._images_lock, self.trail.changing(Change("plan-image", "", None, None)) as change:
            image = self._folder.write(read.content, made.media_type, made.width_px, made.height_px)
            change.item, change.after = image.id, image
            self._images.pop(image.id, None)  # the newest is the last
            self._images[image.id] = image
            self._drop_unused()
        return image

    def put(self, name: str, item: Plan, allows: Precondition = always) -> None:
        """Add or replace a plan and save it. Raises ImageMissingError, and what `NamedItems.put` raises."""
        with self._images_lock:
            if self.image(item.image.id) != item.image:
                raise ImageMissingError
            super().put(name, item, allows)
            self._drop_unused()

    def remove(self, name: str, allows: Precondition = always) -> None:
        """Remove a plan as `NamedItems.remove` does. Its image stays for a while, so that a person can undo this."""
        with self._images_lock:
            plan = self.all[name]
            super().remove(name, allows)
            self._images[plan.image.id] = self._images.pop(plan.image.id)
            self._drop_unused()

    def _drop_unused(self) -> None:
        used = {plan.image.id for plan in self.all.values()}
        unused = [image for image in self._images.values() if image.id not in used]
        for image in unused[:-MAX_UNUSED]:
            del self._images[image.id]
            with suppress(OSError):  # the change itself is saved, and the next start tries again
                self._folder.remove(image)
