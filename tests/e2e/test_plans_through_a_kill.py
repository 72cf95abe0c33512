"""Floor plans survive a killed service."""

import signal
from pathlib import Path

from support.plan_files import image_file
from support.service import running_service, settings_file


def test_an_acknowledged_plan_and_its_image_survive_a_kill(tmp_path: Path) -> None:
    options = ("--config", str(settings_file(tmp_path, [], "")), "--data-dir", str(tmp_path / "data"))
    with running_service(*options) as service:
        uploaded = service.ask("POST", "/api/v1/plan-images", content=image_file(40, 20))
        assert uploaded.status_code == 201, uploaded.text
        image = uploaded.json()["image"]
        plan = {"id": "hall", "image": image, "placement": {"x": 0, "y": 0, "m_per_px": 0.1}}
        service.put("/api/v1/plans/hall", plan)
        shown = service.ask("GET", f"/api/v1/plan-images/{image['id']}").content
        service.stop(signal.SIGKILL)
    with running_service(*options) as service:
        assert [found["id"] for found in service.get("/api/v1/plans")["plans"]] == ["hall"]
        assert service.ask("GET", f"/api/v1/plan-images/{image['id']}").content == shown
        assert service.stop() == 0
