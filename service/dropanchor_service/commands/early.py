"""What must be known of the settings before a command is imported."""

import argparse
from collections.abc import Sequence
from contextlib import suppress
from pathlib import Path


def data_dir_of(words: Sequence[str]) -> Path | None:
    """Return the data folder that a command line, the environment or the settings file names, if any does.

    The command itself reports what is wrong with them.
    """
    from dropanchor_service.settings.sources import SettingsError, load_settings

    parser = argparse.ArgumentParser(add_help=False, allow_abbrev=False, exit_on_error=False)
    parser.add_argument("--config", type=Path)
    parser.add_argument("--data-dir")
    with suppress(SettingsError, argparse.ArgumentError):
        found, _ = parser.parse_known_args(words)
        options = {} if found.data_dir is None else {"data_dir": found.data_dir}
        return load_settings(found.config, options).data_dir
    return None
