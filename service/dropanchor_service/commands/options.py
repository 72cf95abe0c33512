"""Options shared by several commands, and the settings built from them."""

import argparse
from pathlib import Path
from typing import Any

from dropanchor_service.settings.model import Settings
from dropanchor_service.settings.sources import load_settings
from dropanchor_tag_client.command_line import LOG_LEVELS


def add_service_options(parser: argparse.ArgumentParser) -> None:
    add_http_options(parser)
    zenoh = parser.add_mutually_exclusive_group()
    zenoh.add_argument(
        "--zenoh-listen", metavar="ENDPOINT", help="endpoint of the built-in Zenoh router (default: tcp/127.0.0.1:7447)"
    )
    zenoh.add_argument("--zenoh-connect", metavar="ENDPOINT", help="connect to this Zenoh router and start none")
    parser.add_argument("--engine", metavar="NAME", help="estimator: fleet (default) or paper")
    parser.add_argument(
        "--data-dir", metavar="FOLDER", help="folder for changes made over REST, history and recordings"
    )
    add_security_options(parser)
    add_log_option(parser)


def add_http_options(parser: argparse.ArgumentParser) -> None:
    parser.add_argument("--config", type=Path, metavar="FILE", help="settings file (TOML); options override it")
    parser.add_argument("--host", help="address of the page and the REST interface (default: 127.0.0.1)")
    parser.add_argument("--port", type=int, help="port of the page and the REST interface (default: 8080); 0: any free")


def add_security_options(parser: argparse.ArgumentParser) -> None:
    parser.add_argument("--security", metavar="FOLDER", help="folder of credentials from `dropanchor security init`")
    parser.add_argument(
        "--insecure", action="store_true", default=None, help="listen beyond the loopback without credentials"
    )


def add_log_option(parser: argparse.ArgumentParser) -> None:
    parser.add_argument(
        "--log-level", default="INFO", choices=LOG_LEVELS, help="least severity to log (default: %(default)s)"
    )


def positive(text: str) -> int:
    number = int(text)
    if number < 1:
        raise argparse.ArgumentTypeError("at least 1")
    return number


def settings_of(arguments: argparse.Namespace, **more: Any) -> Settings:
    """Return the settings from the options, the environment and the settings file. Raises SettingsError."""
    options: dict[str, Any] = {
        "http": given(host=arguments.host, port=arguments.port),
        "zenoh": given(listen=arguments.zenoh_listen, connect=arguments.zenoh_connect),
        "security": given(folder=arguments.security),
        **given(engine=arguments.engine, data_dir=arguments.data_dir, insecure=arguments.insecure),
        **more,
    }
    return load_settings(arguments.config, {key: value for key, value in options.items() if value != {}})


def router_settings(arguments: argparse.Namespace) -> Settings:
    """Return the settings of a separate router; all others keep their defaults. Raises SettingsError."""
    options = {
        "http": {"host": "127.0.0.1"},
        "zenoh": {"connect": []} | given(listen=arguments.zenoh_listen),
        "security": given(folder=arguments.security),
        **given(insecure=arguments.insecure),
    }
    return load_settings(options=options)


def given(**options: Any) -> dict[str, Any]:
    return {name: value for name, value in options.items() if value is not None}
