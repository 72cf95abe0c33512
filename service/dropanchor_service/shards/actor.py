"""A shard as an actor of Ray. A node that runs an older version starts it by these names: keep them."""

import logging
import os
import threading
import time
from pathlib import Path

CONFIG = "DROPANCHOR_CLUSTER_CONFIG"
"""Environment variable with the settings file of a node. Its shards inherit it."""

_log = logging.getLogger(__name__)


class ShardActor:
    """Runs a shard in a thread, because an error in the constructor would end an actor for good."""

    def __init__(self, name: str) -> None:
        threading.Thread(target=_run, args=(name,), name="shard", daemon=True).start()


def _run(name: str) -> None:
    from dropanchor_service.runtime.kernel_cache import use_kernel_cache

    use_kernel_cache()  # before compiled kernels are imported
    from dropanchor_service.runtime import logs
    from dropanchor_service.runtime.interpreter import prepare_to_serve
    from dropanchor_service.shards.starting import BACK_OFF_S, EXIT_GONE, Starting

    logs.configure()
    prepare_to_serve()
    config = Path(os.environ[CONFIG])
    starting = Starting(name, config)
    starting.begin()
    try:
        from dropanchor_service.shards.shard import run_shard  # which takes seconds
    except Exception as error:  # an incomplete installation
        starting.failed(error)
        _log.exception("the shard %s cannot start", name)
        time.sleep(BACK_OFF_S)
        os._exit(EXIT_GONE)
    run_shard(name, config, starting)
