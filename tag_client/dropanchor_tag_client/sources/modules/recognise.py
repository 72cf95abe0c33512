"""Tell by what arrives which module is on a port: by a measurement in a form that only this module prints."""

from collections.abc import Iterable

from dropanchor_tag_client.sources.modules.catalogue import MODULES
from dropanchor_tag_client.sources.modules.module import Module
from dropanchor_tag_client.sources.modules.patterns.parser import Patterns
from dropanchor_tag_client.sources.modules.report import Drop, Parser, Report

_FAILED = (Drop.ABSURD, Drop.NEGATIVE, Drop.NO_ANSWER)


def unasked() -> list[Module]:
    """Return the modules that can be recognised by what they print of themselves."""
    return [module for module in MODULES.values() if not module.poll and not module.only_named]


def recognised(data: bytes) -> Module | None:
    """Return the module that prints such measurements of itself, if there is one."""
    return next((module for module in unasked() if understands(module.parser(), data)), None)


def understands(parser: Parser, data: bytes) -> bool:
    """Return whether the bytes hold a measurement, were it one that failed. A line without any may be of anything."""
    failed = (Drop.ABSURD, Drop.NEGATIVE) if isinstance(parser, Patterns) else _FAILED
    reports = parser.feed(data)
    return _has_measurement(reports) or (bool(reports) and any(parser.dropped[reason] for reason in failed))


def _has_measurement(reports: Iterable[Report]) -> bool:
    return any(report.ranges or report.imu is not None for report in reports)


def likeness(data: bytes) -> str | None:
    """Return a sentence on the module that prints such lines, but is not recognised by them; None without one."""
    for module in MODULES.values():
        parser = module.parser()
        reports = [] if module.poll else parser.feed(data)
        if _has_measurement(reports):
            return f"{module.name} prints such lines, and other boards do, too: --module {module.name} if it is one."
        if parser.dropped[Drop.POSITION_ONLY]:
            return (
                f"A {module.name} prints positions so (lep). Ranges are needed: type `lec`, or --module {module.name}."
            )
        if reports and not parser.dropped[Drop.NO_ANSWER]:
            return f"{module.name} prints such lines; these hold no distance. {module.hint}"
    return None
