"""`dropanchor settings`: show every setting that is in force, where it comes from, and what it hides."""

import argparse
import json
import re
import sys
from collections.abc import Iterator, Mapping, Sequence
from contextlib import suppress

from dropanchor_schemas.settings_values import HeldValue, SettingValue
from dropanchor_service.commands.options import add_service_options, settings_of
from dropanchor_service.persistence.site import saved_site
from dropanchor_service.settings.layers import service_settings
from dropanchor_service.settings.model import Settings
from dropanchor_service.settings.sources import SettingsError
from dropanchor_service.store.settings_values import values_of_site

DESCRIPTION = """\
Shows every setting in force with these options, this environment, this settings file and this data folder, where it
comes from, and what it hides. The service need not run, and nothing is changed. A value that was set over REST or on
the page wins over the command line, then the environment, then the settings file, then the default.
"""
EPILOG = """\
examples:
  dropanchor settings --show --config yard.toml --data-dir /var/lib/dropanchor
  dropanchor settings --show --config yard.toml --set-only
  dropanchor settings --show --config yard.toml --json | jq '.settings[] | select(.source == "rest")'
"""
REFUSED = (SettingsError,)
_OF_SITES = ("site", "tags", "tag_defaults", "sites")
_WORDS = {"rest": "set over REST", "first_range": "the anchor of the first range"}


def add_arguments(parser: argparse.ArgumentParser) -> None:
    parser.add_argument("--show", action="store_true", required=True, help="show the settings")
    parser.add_argument("--set-only", action="store_true", help="leave out what is as by default")
    parser.add_argument("--json", action="store_true", help="write JSON")
    add_service_options(parser)


def run(arguments: argparse.Namespace) -> None:
    """Show the settings. Raises REFUSED."""
    settings = settings_of(arguments)
    shown = dict(_all(settings))
    if settings.cluster.url is not None:
        sys.stderr.write("What was set over REST is in the database of the cluster: GET /api/v1/settings shows it.\n")
    if arguments.set_only:
        shown = {site: [one for one in values if one.source != "default"] for site, values in shown.items()}
    with suppress(BrokenPipeError):
        print(_json(shown) if arguments.json else "\n".join(_lines(shown)))


def _all(settings: Settings) -> Iterator[tuple[str | None, list[SettingValue]]]:
    """Yield the settings of the service, and then those of each site with its id. Raises SettingsError."""
    yield None, list(service_settings(settings, settings.layers, _OF_SITES))
    for name in settings.site_ids:
        yield name, values_of_site(saved_site(settings, name))


def _json(shown: Mapping[str | None, Sequence[SettingValue]]) -> str:
    found = [{"site": site, **value.model_dump()} for site, values in shown.items() for value in values]
    return json.dumps({"settings": found}, indent=2, ensure_ascii=False)


def _lines(shown: Mapping[str | None, Sequence[SettingValue]]) -> Iterator[str]:
    for site, values in shown.items():
        if site is not None:
            yield f"\nsite {site}"
        for value in values:
            hides = "".join(
                f", hides {_text(one.value)}: {_source(one)}" for one in value.hides if one.source != "default"
            )
            yield f"{_key(value.path)} = {_text(value.value)}  [{_source(value)}{hides}]"


def _source(value: HeldValue) -> str:
    where = value.file or _WORDS.get(value.source, value.source.replace("_", " "))
    return f"{where} {_key(value.at)}" if value.file else where


def _key(path: Sequence[str]) -> str:
    """Return the key as TOML writes it."""
    return ".".join(part if re.fullmatch("[A-Za-z0-9_-]+", part) else json.dumps(part) for part in path)


def _text(value: object) -> str:
    return "not set" if value is None else json.dumps(value, ensure_ascii=False)
