"""Write the JSON Schemas and the AsyncAPI document of the contract. With --check, test whether they are current."""

import json
import sys
from pathlib import Path

from pydantic import BaseModel

from dropanchor_schemas import asyncapi
from dropanchor_schemas.events import Event
from dropanchor_schemas.explain import Explanation
from dropanchor_schemas.pose import Pose, PoseFrame, PoseList
from dropanchor_schemas.samples import SamplesMessage
from dropanchor_schemas.site import Anchor, RemoteSettings, Site, TagSettings
from dropanchor_schemas.tag_health import TagHealthMessage
from dropanchor_schemas.zones import Zone

FOLDER = Path(__file__).parent / "json"
ASYNCAPI = "asyncapi.json"
MODELS: dict[str, type[BaseModel]] = {
    "samples": SamplesMessage,
    "health": TagHealthMessage,
    "pose": Pose,
    "poses": PoseList,
    "pose_frame": PoseFrame,
    "explanation": Explanation,
    "remote_settings": RemoteSettings,
    "site": Site,
    "anchor": Anchor,
    "tag_settings": TagSettings,
    "event": Event,
    "zone": Zone,
}


def schemas() -> dict[Path, str]:
    """Return the text of every exported file, by path."""
    documents = {f"{name}.schema.json": model.model_json_schema() for name, model in MODELS.items()}
    documents[ASYNCAPI] = asyncapi.document()
    return {
        FOLDER / name: json.dumps(document, indent=2, ensure_ascii=False) + "\n" for name, document in documents.items()
    }


def main(arguments: list[str]) -> int:
    texts = schemas()
    if arguments == ["--check"]:
        stale = [path.name for path, text in texts.items() if not path.exists() or path.read_text() != text]
        if stale:
            sys.stderr.write(f"not current: {', '.join(stale)}; run python -m dropanchor_schemas.export\n")
        return 1 if stale else 0
    FOLDER.mkdir(exist_ok=True)
    for path, text in texts.items():
        path.write_text(text)
    return 0


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
