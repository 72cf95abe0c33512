"""Options that several commands have, and the settings they make."""

import argparse
from pathlib import Path
from typing import Any

from dropanchor_service.settings.model import Settings
from dropanchor_service.settings.sources import load_settings


def add_service_options(parser: argparse.ArgumentParser) -> None:
    parser.add_argument("--config", type=Path, metavar="FILE", help="settings (TOML); options given here win over it")
    parser.add_argument("--host", help="address of the page and the REST interface (127.0.0.1)")
    parser.add_argument("--port", type=int, help="its port (8080); 0 takes any free one")
    zenoh = parser.add_mutually_exclusive_group()
    zenoh.add_argument(
        "--zenoh-listen", metavar="ENDPOINT", help="where our own Zenoh router listens (tcp/127.0.0.1:7447)"
    )
    zenoh.add_argument("--zenoh-connect", metavar="ENDPOINT", help="use the Zenoh router there, start none")
    parser.add_argument("--engine", metavar="NAME", help="the estimator: fleet (default) or paper")
    parser.add_argument("--data-dir", metavar="FOLDER", help="keep changes made over REST here")
    add_security_options(parser)
    add_log_option(parser)


def add_security_options(parser: argparse.ArgumentParser) -> None:
    parser.add_argument("--security", metavar="FOLDER", help="credentials made by `dropanchor security init`")
    parser.add_argument(
        "--insecure", action="store_true", default=None, help="listen beyond the loopback without credentials"
    )


def add_log_option(parser: argparse.ArgumentParser) -> None:
    parser.add_argument("--log-level", default="INFO", choices=("DEBUG", "INFO", "WARNING", "ERROR"))


def positive(text: str) -> int:
    number = int(text)
    if number < 1:
        raise argparse.ArgumentTypeError("at least 1")
    return number


def settings_of(arguments: argparse.Namespace, **more: Any) -> Settings:
    """Raises SettingsError."""
    options: dict[str, Any] = {
        "http": _given(host=arguments.host, port=arguments.port),
        "zenoh": _given(listen=arguments.zenoh_listen, connect=arguments.zenoh_connect),
        "security": _given(folder=arguments.security),
        **_given(engine=arguments.engine, data_dir=arguments.data_dir, insecure=arguments.insecure),
        **more,
    }
    return load_settings(arguments.config, {key: value for key, value in options.items() if value != {}})


def router_settings(arguments: argparse.Namespace) -> Settings:
    """Of a router alone: the settings of everything else do not matter. Raises SettingsError."""
    options = {
        "http": {"host": "127.0.0.1"},
        "zenoh": {"connect": []} | _given(listen=arguments.zenoh_listen),
        "security": _given(folder=arguments.security),
        **_given(insecure=arguments.insecure),
    }
    return load_settings(options=options)


def _given(**options: Any) -> dict[str, Any]:
    return {name: value for name, value in options.items() if value is not None}
