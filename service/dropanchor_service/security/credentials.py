"""Load the credentials that the settings name."""

import logging
from contextlib import suppress
from datetime import datetime, timedelta

from dropanchor_service.runtime.recovery import NewerFileError, Recovery
from dropanchor_service.security import api_keys, share_links
from dropanchor_service.security.access_control import SERVICE
from dropanchor_service.security.api_keys import ApiKeyError, ApiKeys
from dropanchor_service.security.authority import expiry
from dropanchor_service.security.certificate import Certificate
from dropanchor_service.security.folder import SecurityError, SecurityFolder
from dropanchor_service.security.identity import Authenticator, IdentityProvider
from dropanchor_service.security.share_links import ShareLinks
from dropanchor_service.settings.http import HttpSettings
from dropanchor_service.settings.model import Settings
from dropanchor_service.settings.sources import SettingsError

EXPIRY_WARNING = timedelta(days=30)

_log = logging.getLogger(__name__)


def credentials_of(settings: Settings) -> SecurityFolder | None:
    """Open the folder of credentials, and warn about certificates that expire soon.

    Return None when no folder is set. Raises SettingsError when the folder cannot be used.
    """
    if settings.security.folder is None:
        return None
    try:
        folder = SecurityFolder.open(settings.security.folder)
        for site in settings.sites if len(settings.sites) > 1 else ():
            folder.site_named(site)
    except SecurityError as error:
        raise SettingsError(f"security.folder: {error}") from error
    for sentence in folder.expiring(EXPIRY_WARNING):
        _log.warning(
            "%s; renew it with `dropanchor security renew`, or with `dropanchor tag add --renew` for a tag", sentence
        )
    return folder


def expiries_of(certificate: Certificate | None, credentials: SecurityFolder | None) -> dict[str, datetime]:
    """Return when each certificate ends, by its name: `http`, those of the site, and of `tags` the first one.

    It reads the files again, since they may have been renewed. What cannot be read is left out.
    """
    found: dict[str, datetime] = {}
    with suppress(OSError, ValueError):
        if certificate is not None:
            found["http"] = expiry(certificate.certificate.read_bytes())
    with suppress(SecurityError):
        if credentials is not None:
            folder = SecurityFolder.open(credentials.path)
            found |= folder.expiries()
            of_tags = [folder.table.tags[name].expires for name in folder.table.admitted]
            found |= {"tags": min(of_tags)} if of_tags else {}
    return found


def certificate_of(settings: HttpSettings, credentials: SecurityFolder | None) -> Certificate | None:
    """Return the certificate of the HTTP server; None for plain HTTP."""
    if not settings.tls:
        return None
    if settings.certificate is not None and settings.key is not None:
        return Certificate(settings.certificate, settings.key)
    return None if credentials is None else Certificate(credentials.certificate(SERVICE), credentials.key(SERVICE))


def authenticator_of(settings: Settings, recovery: Recovery | None = None) -> Authenticator | None:
    """Return what authenticates REST requests; None when anonymous access is allowed. Raises SettingsError.

    recovery: reports damaged files of share links.
    """
    providers = _providers_of(settings)
    folder = settings.data_dir or settings.security.folder
    if not providers:
        return None
    if folder is None:
        return Authenticator(providers)
    try:
        links = ShareLinks(folder, recovery=recovery)
    except NewerFileError as error:
        raise SettingsError(f"share links: {error}") from error
    return Authenticator({share_links.SOURCE: links, **providers})


def keys_and_tokens_of(settings: Settings) -> Authenticator | None:
    """Return what authenticates API keys and tokens, but no share links; None when anonymous access is allowed.

    Raises SettingsError.
    """
    providers = _providers_of(settings)
    return Authenticator(providers) if providers else None


def _providers_of(settings: Settings) -> dict[str, IdentityProvider]:
    providers: dict[str, IdentityProvider] = {}
    security = settings.security
    try:
        if security.folder is not None:
            providers[api_keys.SOURCE] = ApiKeys(security.folder, is_copied=settings.cluster.url is not None)
    except ApiKeyError as error:
        raise SettingsError(f"security.folder: {error}") from error
    if security.oidc is not None:
        from dropanchor_service.security import oidc  # with its libraries, 3 MB of memory

        of_sites = {name: site.oidc_scopes for name, site in settings.sites.items()}
        providers[oidc.SOURCE] = oidc.OidcTokens(security.oidc, of_sites)
    return providers
