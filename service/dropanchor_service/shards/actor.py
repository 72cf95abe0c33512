"""A shard as an actor of Ray."""

import os
import threading
from pathlib import Path

CONFIG = "DROPANCHOR_CLUSTER_CONFIG"
"""Environment variable with the settings file of a node. Its shards inherit it."""


class ShardActor:
    """Runs a shard in a thread, because an error in the constructor would end an actor for good."""

    def __init__(self, name: str) -> None:
        threading.Thread(target=_run, args=(name,), name="shard", daemon=True).start()


def _run(name: str) -> None:
    from dropanchor_service.runtime.kernel_cache import use_kernel_cache

    use_kernel_cache()  # before compiled kernels are imported
    from dropanchor_service.runtime import logs
    from dropanchor_service.runtime.interpreter import prepare_to_serve
    from dropanchor_service.shards.starting import Starting

    logs.configure()
    prepare_to_serve()
    config = Path(os.environ[CONFIG])
    starting = Starting(name, config)
    starting.begin()
    from dropanchor_service.shards.shard import run_shard  # which takes seconds

    run_shard(name, config, starting.end)
