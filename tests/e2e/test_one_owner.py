"""A folder has one process that writes it. The second one ends with a sentence that says who has it."""

import signal
import socket
from pathlib import Path

from support.commands import Ended
from support.service import ended, running_service
from support.zenoh_router import free_endpoint


def second(folder: Path) -> Ended:
    return ended("serve", "--port", "0", "--zenoh-listen", free_endpoint(), "--data-dir", str(folder))


def test_a_second_service_with_the_data_folder_ends_and_says_who_has_it(tmp_path: Path) -> None:
    with running_service("--data-dir", str(tmp_path)) as service:
        service.put("/api/v1/anchors/gate", {"id": "gate", "x": 1.5, "y": 2.0, "z": 0.0})
        refused = second(tmp_path)
        assert refused.returncode == 2
        (line,) = refused.stderr.splitlines()
        owner = f"process {service.process.pid} on {socket.gethostname()} since 20"
        assert line.startswith(f"dropanchor serve: data_dir: {tmp_path} is in use by {owner}")
        assert line.endswith("stop it, or give this process a folder of its own")
        service.stop(signal.SIGKILL)
    with running_service("--data-dir", str(tmp_path)) as service:  # the kernel has released the lock
        assert [anchor["id"] for anchor in service.get("/api/v1/anchors")["anchors"]] == ["gate"]
        assert service.stop() == 0


def test_a_service_whose_lock_is_a_link_ends_and_overwrites_nothing(tmp_path: Path) -> None:
    target, folder = tmp_path / "shadow", tmp_path / "data"
    target.write_text("root:x")
    folder.mkdir()
    (folder / "owner.lock").symlink_to(target)
    refused = second(folder)
    assert refused.returncode == 2
    assert f"data_dir: {folder}/owner.lock is a link, and would overwrite what it leads to" in refused.stderr
    assert target.read_text() == "root:x"
