"""Enough threads for a router to close dead connections without keeping living ones waiting.

A tag that vanishes without closing its connection (no power, no Wi-Fi) leaves data that it never acknowledges. When
Zenoh closes such a TCP or TLS connection, `close` blocks a receive thread for up to 10 s (`SO_LINGER`), and Zenoh
starts two of them: a handful of such tags would silence all others for tens of seconds.
"""

import os

VARIABLE = "ZENOH_RUNTIME"
COUNT = 256
"""As many tags can vanish at once. Together the threads cost a router 3.7 MB, and 0.3 % of a core or less at rest."""


def have_enough() -> None:
    """Tell Zenoh how many receive threads to start, unless the environment does. It must not be in use yet: Zenoh
    reads the variable once, when it first runs anything."""
    os.environ.setdefault(VARIABLE, f"(rx: (worker_threads: {COUNT}, max_blocking_threads: {COUNT}))")
