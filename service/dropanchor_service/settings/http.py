"""Settings of the page and the REST interface."""

import re
from ipaddress import ip_network
from pathlib import Path
from typing import Annotated

from pydantic import AfterValidator, BeforeValidator, Field, IPvAnyNetwork, model_validator

from dropanchor_schemas.models import Exact
from dropanchor_service.settings.lists import as_list

Port = Annotated[int, Field(ge=0, le=65535)]


def _is_origin(text: str) -> str:
    if text != "*" and not re.fullmatch(r"https?://[^/?#\s]+", text):
        raise ValueError('an origin such as https://board.example was expected, or "*" for all')
    return text


def _is_host(text: str) -> str:
    if text != "*" and not re.fullmatch(r"(\*\.)?[A-Za-z0-9_-]+(\.[A-Za-z0-9_-]+)*\.?", text):
        raise ValueError("a name such as yard.example was expected, without a scheme or port")
    return text


HostNames = Annotated[tuple[Annotated[str, AfterValidator(_is_host)], ...], BeforeValidator(as_list)]
Networks = Annotated[tuple[IPvAnyNetwork, ...], BeforeValidator(as_list)]
Origins = Annotated[tuple[Annotated[str, AfterValidator(_is_origin)], ...], BeforeValidator(as_list)]


class HttpSettings(Exact):
    """Where the page and the REST interface are served."""

    host: str = Field(default="127.0.0.1", min_length=1, description="Address to listen on.")
    port: Port = Field(default=8080, description="Port to listen on; 0 takes any free one.")
    tls: bool = Field(
        default=True, description="Serve HTTPS where there is a certificate. Turn it off behind a proxy that ends TLS."
    )
    certificate: Path | None = Field(
        default=None, description="PEM file with its chain; without it, the certificate of `security.folder`."
    )
    key: Path | None = Field(default=None, description="PEM file with the private key of the certificate.")
    trusted_proxies: Networks = Field(
        default=(ip_network("127.0.0.1"), ip_network("::1")),
        description="Networks of reverse proxies. The service believes the headers `X-Forwarded-For`, `-Proto` and "
        "`-Prefix` of these and of nobody else.",
    )
    requests_per_s: Annotated[float, Field(ge=0.1, le=1e6)] = Field(
        default=200.0,
        description="Requests that one key, token or address may make per second, on average. There is no limit on the "
        "loopback without credentials.",
    )
    burst: Annotated[int, Field(ge=1, le=1_000_000)] = Field(
        default=400, description="Requests that it may make at once."
    )
    allowed_hosts: HostNames = Field(
        default=(),
        description="Names by which clients may call the service, such as that of a proxy before it: "
        '`["yard.example"]`, `["*.example"]`. IP addresses, `localhost`, the names in certificates and, beyond the '
        "loopback, the name of the machine are always allowed. Requests for another name are refused, since a page "
        'could have turned it to this machine. `["*"]`: all.',
    )
    cors_origins: Origins = Field(
        default=(),
        description='Origins of other web pages that may use the REST interface, such as `["https://board.example"]`; '
        '`["*"]`: all. They need a key like any other client.',
    )

    @model_validator(mode="after")
    def _certificate_has_a_key(self) -> "HttpSettings":
        if (self.certificate is None) != (self.key is None):
            raise ValueError("certificate and key go together: give both or neither")
        return self
