"""The supported modules: those that need a parser of their own, and those that are a pattern."""

from collections.abc import Iterator, Mapping
from pathlib import Path

from dropanchor_tag_client.sources.modules.dwm1001 import Dwm1001
from dropanchor_tag_client.sources.modules.dwm3001 import Dwm3001
from dropanchor_tag_client.sources.modules.linktrack import LinkTrack
from dropanchor_tag_client.sources.modules.makerfabs import Makerfabs
from dropanchor_tag_client.sources.modules.module import Module
from dropanchor_tag_client.sources.modules.trek1000 import Trek1000

SUFFIX = ".toml"
"""Of files that describe a module by patterns."""

_WITH_PARSER = (
    Module("dwm1001", 115_200, Dwm1001, (b"\r\r", b"lec\r"), "Is it set up as a tag, and is an anchor on?"),
    Module(
        "dwm3001",
        115_200,
        Dwm3001,
        (),
        'Start ranging: INITF on one side and RESPF on the other; --start "INITF" sends it.',
    ),
    Module("trek1000", 115_200, Trek1000, (b"deca$",), "Is an anchor on, and in the same mode?"),
    Module("makerfabs", 115_200, Makerfabs, (b"AT+SETRPT=1\r\n",), "Is it set up (AT+SETCFG), and is an anchor on?"),
    Module("linktrack", 921_600, LinkTrack, (), "Choose NodeFrame 2 or 3 as its protocol in the vendor's program."),
)


class _Catalogue(Mapping[str, Module]):
    """The modules by name. The file of a pattern is read when somebody asks for it: a small computer runs one."""

    def __init__(self) -> None:
        self._known = {module.name: module for module in _WITH_PARSER}
        self._files = {path.stem: path for path in sorted((Path(__file__).parent / "shipped").glob(f"*{SUFFIX}"))}

    def __getitem__(self, name: str) -> Module:
        if name not in self._known:
            # 1.4 MB, which a module with a parser of its own does not need
            from dropanchor_tag_client.sources.modules.patterns.files import module_of_file

            self._known[name] = module_of_file(self._files[name])
        return self._known[name]

    def __iter__(self) -> Iterator[str]:
        yield from (module.name for module in _WITH_PARSER)
        yield from self._files

    def __len__(self) -> int:
        return len(_WITH_PARSER) + len(self._files)


MODULES = _Catalogue()
