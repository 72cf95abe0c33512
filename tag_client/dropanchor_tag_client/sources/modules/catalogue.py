"""The supported modules: those that need a parser of their own, and those that are a pattern."""

from dropanchor_tag_client.sources.modules.dwm1001 import Dwm1001
from dropanchor_tag_client.sources.modules.dwm3001 import Dwm3001
from dropanchor_tag_client.sources.modules.linktrack import LinkTrack
from dropanchor_tag_client.sources.modules.makerfabs import Makerfabs
from dropanchor_tag_client.sources.modules.module import Module
from dropanchor_tag_client.sources.modules.patterns.files import shipped_modules
from dropanchor_tag_client.sources.modules.trek1000 import Trek1000

MODULES = {
    module.name: module
    for module in (
        Module("dwm1001", 115_200, Dwm1001, (b"\r\r", b"lec\r"), "Is it set up as a tag, and is an anchor on?"),
        Module(
            "dwm3001",
            115_200,
            Dwm3001,
            (),
            'Start ranging: INITF on one side and RESPF on the other; --start "INITF" sends it.',
        ),
        Module("trek1000", 115_200, Trek1000, (b"deca$",), "Is an anchor on, and in the same mode?"),
        Module(
            "makerfabs", 115_200, Makerfabs, (b"AT+SETRPT=1\r\n",), "Is it set up (AT+SETCFG), and is an anchor on?"
        ),
        Module("linktrack", 921_600, LinkTrack, (), "Choose NodeFrame 2 or 3 as its protocol in the vendor's program."),
        *shipped_modules(),
    )
}
