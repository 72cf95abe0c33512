"""The images of floor plans: one file each, named by a digest of its content."""

import hashlib
import re
from collections.abc import Collection
from contextlib import suppress
from functools import partial
from pathlib import Path

from dropanchor_schemas.plans import ImageType, PlanImage
from dropanchor_schemas.sentences import say
from dropanchor_service.runtime.atomic_file import write_atomically
from dropanchor_service.runtime.open_below import open_below
from dropanchor_service.runtime.recovery import Recovery

_ENDINGS: dict[ImageType, str] = {"image/png": ".png", "image/jpeg": ".jpg", "image/svg+xml": ".svg"}
_DIGEST_CHARACTERS = 32
INSTEAD = say("plan_again", "upload the image of the floor plan again")
_NAME = re.compile(r"[0-9a-f]{32}\.(png|jpg|svg)(\.part)?")


class ImageFolder:
    """Stores images in a folder, or in memory without one."""

    def __init__(self, folder: Path | None) -> None:
        self._folder = folder
        self._in_memory: dict[str, bytes] = {}

    def write(self, content: bytes, media_type: ImageType, width_px: int, height_px: int) -> PlanImage:
        """Store an image and describe it. Raises OSError."""
        digest = _digest(content)
        image = PlanImage(id=digest, media_type=media_type, width_px=width_px, height_px=height_px)
        if self._folder is None:
            self._in_memory[digest] = content
        else:
            write_atomically(self._path(self._folder, image), [content])
        return image

    def read(self, image: PlanImage) -> bytes | None:
        """Return the content of an image; None if it is not there."""
        if self._folder is None:
            return self._in_memory.get(image.id)
        try:
            with open_below(self._folder, self._path(self._folder, image).name) as file:
                return file.read()
        except FileNotFoundError:
            return None

    def remove(self, image: PlanImage) -> None:
        """Delete an image. Raises OSError."""
        self._in_memory.pop(image.id, None)
        if self._folder is not None:
            self._path(self._folder, image).unlink(missing_ok=True)

    def delete_others(self, images: Collection[PlanImage]) -> None:
        """Delete all images but these, and what a killed writer has left."""
        if self._folder is None:
            return
        kept = {self._path(self._folder, image) for image in images}
        for path in self._folder.glob("*"):
            if path not in kept and _NAME.fullmatch(path.name):
                with suppress(OSError):  # a disk that is read-only: the next start tries again
                    path.unlink()

    def check(self, images: Collection[PlanImage], recovery: Recovery) -> None:
        """Set aside those of these images that are damaged."""
        if self._folder is not None:
            for image in images:
                recovery.read_alone(self._path(self._folder, image), partial(_require, image.id), INSTEAD)

    def _path(self, folder: Path, image: PlanImage) -> Path:
        return folder / f"{image.id}{_ENDINGS[image.media_type]}"


def _digest(content: bytes) -> str:
    return hashlib.sha256(content).hexdigest()[:_DIGEST_CHARACTERS]


def _require(digest: str, content: bytes) -> None:
    """Raise ValueError unless this is the digest of the content."""
    if _digest(content) != digest:
        raise ValueError
