"""The folder that `dropanchor security init` creates: certificates, issued tags, and the router's configuration."""

import json
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from datetime import UTC, datetime, timedelta
from pathlib import Path
from typing import Any, Self

from pydantic import ValidationError

from dropanchor_schemas.file_names import file_name_of
from dropanchor_schemas.keys import chunk_from_id
from dropanchor_service.runtime.atomic_file import write_atomically
from dropanchor_service.runtime.written_by import later_in, mark
from dropanchor_service.security.access_control import READER, ROLES, ROUTER, SERVICE, reader_of
from dropanchor_service.security.api_keys import FOLDER as API_KEYS
from dropanchor_service.security.authority import Authority, Issued, expiry
from dropanchor_service.security.files import LOCK, PRIVATE, PUBLIC, exclusive_lock
from dropanchor_service.security.issued import IssuedTag, Table
from dropanchor_service.security.router import router_configuration
from dropanchor_service.security.router_file import RouterFileError, endpoints_in

TABLE = "issued.json"
ROUTER_FILE = "router.json5"
MAX_COMMON_NAME_BYTES = 64  # RFC 5280, ub-common-name


class SecurityError(ValueError):
    """Credentials cannot be created or used; the message says what to do."""


class SecurityFolder:
    """Reads and changes the folder. Files are written atomically; only the owner can read private keys."""

    def __init__(self, path: Path, table: Table) -> None:
        self.path = path
        self.table = table

    @classmethod
    def open(cls, path: Path) -> Self:
        """Read the folder. Raises SecurityError when it is missing or damaged."""
        try:
            return cls(path, Table.model_validate_json((path / TABLE).read_bytes()))
        except FileNotFoundError as error:
            raise SecurityError(
                f"there are no credentials in {path}; create them with: dropanchor security init --security {path}"
            ) from error
        except OSError as error:
            raise SecurityError(f"the credentials in {path} cannot be read: {error.strerror}") from error
        except ValidationError as error:
            damaged = f"{path / TABLE} is damaged: {error.errors()[0]['msg']}"
            raise SecurityError(later_in(path / TABLE, error) or damaged) from error

    @classmethod
    def make(cls, path: Path, table: Table, days: int) -> Self:
        """Create a new authority, and certificates for router, service and reader.

        days: the lifetime of the certificates. Raises SecurityError when the folder is not empty or not writable.
        """
        folder = cls(path, table)
        try:
            path.mkdir(parents=True, exist_ok=True, mode=0o700)
            folder._refuse_full()
            with exclusive_lock(path):
                folder._refuse_full()
                folder._fill(days)
        except OSError as error:
            raise SecurityError(f"{path} cannot be written: {error.strerror}") from error
        return folder

    def _refuse_full(self) -> None:
        """Raise SecurityError when the folder is not empty."""
        if any(found.name != LOCK for found in self.path.iterdir()):
            raise SecurityError(
                f"{self.path} is not empty, and existing files are never overwritten; choose another folder"
            )

    def _fill(self, days: int) -> None:
        """Create everything. Raises OSError."""
        (self.path / API_KEYS).mkdir(mode=0o700)  # for who mounts it, even before there is a key
        authority = Authority.make("Dropanchor site authority")
        self._write_pair("ca", authority.issued)
        self._issue_roles(authority, days)
        self._save(self.table)

    def renew(self, hosts: Sequence[str], days: int) -> None:
        """Issue new certificates to router, service and reader. Raises SecurityError.

        hosts: additional names or addresses of the router. days: the lifetime of the certificates.
        """
        with self._changing():
            authority = self._authority()
            all_hosts = tuple(dict.fromkeys([*self.table.hosts, *hosts]))
            self._save(self.table.model_copy(update={"hosts": all_hosts}))
            self._issue_roles(authority, days)

    def add_site(self, site: str, days: int) -> None:
        """Let the router serve another site, and issue a certificate to a reader of each site. Raises SecurityError."""
        with self._changing():
            file_name_of(site)
            if site in self.table.sites:
                raise SecurityError(f"the site {site!r} is there already")
            taken = [name for name in (reader_of(one) for one in (*self.table.sites, site)) if name in self.table.tags]
            if taken or len(reader_of(site).encode()) > MAX_COMMON_NAME_BYTES:
                why = "a tag has the name of its reader" if taken else "its name is too long for a certificate"
                raise SecurityError(f"the site {site!r} cannot be added: {why}")
            authority, before = self._authority(), self.table.more_sites
            self._save(self.table.model_copy(update={"more_sites": (*before, site)}))
            for one in (site,) if before else self.table.sites:
                self._issue_reader(authority, one, days)

    def expiring(self, within: timedelta) -> list[str]:
        """Return a sentence for each certificate that expires `within` this time.

        It checks the certificates in the folder and those of admitted tags.
        """
        limit = datetime.now(UTC) + within
        expiries = {f"the certificate {self.certificate(name)}": end for name, end in self.expiries().items()}
        expiries |= {f"the certificate of tag {name!r}": self.table.tags[name].expires for name in self.table.admitted}
        return [f"{what} expires on {end:%Y-%m-%d}" for what, end in expiries.items() if end < limit]

    def expiries(self) -> dict[str, datetime]:
        """Return when each certificate in the folder expires, by its name. Those that are missing are left out."""
        found = {name: self._expires(name) for name in ("ca", *ROLES, *map(_reader_file, self._sites_with_readers))}
        return {name: end for name, end in found.items() if end is not None}

    def add_tag(self, tag: str, days: int, renew: bool = False, site: str | None = None) -> Path:
        """Issue a certificate to a tag, and return the folder to copy onto it.

        renew: replace the certificate that the tag has. site: of the tag; None: the only one. Raises SecurityError or
        InvalidKeyError.
        """
        with self._changing():
            of_site = self.site_named(site)
            name = self.table.common_name(of_site, tag)
            chunk_from_id(tag)
            self._refuse_tag(name, renew)
            bundle = self.bundle(name)
            issued = self._authority().client(name, days)
            bundle.mkdir(parents=True, exist_ok=True, mode=0o700)
            write_atomically(bundle / "ca.pem", [(self.path / "ca.pem").read_bytes()], PUBLIC)
            write_atomically(bundle / "tag.pem", [issued.certificate], PUBLIC)
            write_atomically(bundle / "tag.key", [issued.key], PRIVATE)
            write_atomically(bundle / "tag.json", [_json(self._connection(of_site, tag))], PUBLIC)
            others = None if of_site == self.table.site else of_site
            entry = IssuedTag(serial=issued.serial, expires=issued.expires, site=others)
            self._save(self.table.model_copy(update={"tags": {**self.table.tags, name: entry}}))
        return bundle

    def revoke_tag(self, tag_id: str, site: str | None = None) -> None:
        """Mark the certificate of a tag as revoked. Raises SecurityError when the tag has none; see `add_tag`."""
        with self._changing():
            name = self.table.common_name(self.site_named(site), tag_id)
            tag = self.table.tags.get(name)
            if tag is None or tag.revoked is not None:
                raise SecurityError(f"tag {name!r} " + ("is revoked already" if tag else "has no certificate"))
            revoked = tag.model_copy(update={"revoked": datetime.now(UTC)})
            self._save(self.table.model_copy(update={"tags": {**self.table.tags, name: revoked}}))

    def site_named(self, site: str | None) -> str:
        """Return the site with this id; with None, the only one. Raises SecurityError."""
        if site is None and len(self.table.sites) > 1:
            raise SecurityError(f"say which site it is of, with --site: {', '.join(self.table.sites)}")
        if site is not None and site not in self.table.sites:
            raise SecurityError(
                f"there is no site {site!r} in {self.path}, which has {', '.join(self.table.sites)}; add it with: "
                f"dropanchor security add-site {site}"
            )
        return site or self.table.site

    def bundle(self, name: str) -> Path:
        """Return the folder with the credentials of the tag whose certificate has this common name.

        Raises InvalidKeyError if the name cannot be that of a folder.
        """
        return self.path / "tags" / file_name_of(name)

    def certificate(self, role: str) -> Path:
        return self.path / f"{role}.pem"

    def key(self, role: str) -> Path:
        return self.path / f"{role}.key"

    @property
    def router_file(self) -> Path:
        return self.path / ROUTER_FILE

    @property
    def listen(self) -> tuple[str, ...]:
        """The endpoints of the router: those in its file, which a person may change. Raises SecurityError."""
        try:
            return endpoints_in(self.router_file) or self.table.listen
        except RouterFileError as error:
            raise SecurityError(str(error)) from error

    def router_configuration(self, listen: Sequence[str] | None = None) -> dict[str, Any]:
        """Return the Zenoh configuration of the router, with access control for the tags admitted now."""
        files = {name: str(path.resolve()) for name, path in self._tls_files().items()}
        holders = [self.table.holder(name) for name in self.table.admitted]
        return router_configuration(self.table.sites, holders, listen or self.listen, files)

    def _issue_roles(self, authority: Authority, days: int) -> None:
        for role in (ROUTER, SERVICE):
            self._write_pair(role, authority.server(role, self.table.hosts, days))
        self._write_pair(READER, authority.client(READER, days))
        for site in self._sites_with_readers:
            self._issue_reader(authority, site, days)

    @property
    def _sites_with_readers(self) -> Sequence[str]:
        """The sites with a reader of their own: all, or none of an only one."""
        return self.table.sites if self.table.more_sites else ()

    def _issue_reader(self, authority: Authority, site: str, days: int) -> None:
        self._write_pair(_reader_file(site), authority.client(reader_of(site), days))

    def _expires(self, name: str) -> datetime | None:
        """Return when a certificate expires; None when it is missing, since not every host needs all of them."""
        try:
            return expiry(self.certificate(name).read_bytes())
        except (OSError, ValueError):
            return None

    def _tls_files(self) -> dict[str, Path]:
        return {"ca": self.certificate("ca"), "certificate": self.certificate(ROUTER), "key": self.key(ROUTER)}

    def _refuse_tag(self, name: str, renew: bool) -> None:
        if len(name.encode()) > MAX_COMMON_NAME_BYTES:
            raise SecurityError(
                f"{name!r} is too long for a certificate: a name may have {MAX_COMMON_NAME_BYTES} bytes"
            )
        if name in ROLES or name in map(reader_of, self._sites_with_readers):
            raise SecurityError(f"{name!r} is a reserved name; choose another name for the tag")
        existing = self.table.tags.get(name)
        if existing is None:
            if renew:
                raise SecurityError(f"tag {name!r} has no certificate to renew")
        elif existing.revoked is not None and existing.expires > datetime.now(UTC):
            raise SecurityError(
                f"tag {name!r} was revoked; adding it again would also admit its old certificate, which expires on "
                f"{existing.expires:%Y-%m-%d}; choose another name"
            )
        elif existing.revoked is None and not renew:
            raise SecurityError(f"tag {name!r} has a certificate already; replace it with --renew")

    def _connection(self, site: str, tag: str) -> dict[str, str]:
        """Return the contents of `tag.json`: who the tag is and where it connects."""
        port = self.listen[0].rpartition(":")[2]
        host = self.table.hosts[0]
        host = f"[{host}]" if ":" in host else host
        return {"tag": tag, "site": site, "connect": f"tls/{host}:{port}"}

    def _authority(self) -> Authority:
        try:
            return Authority(Issued((self.path / "ca.pem").read_bytes(), (self.path / "ca.key").read_bytes()))
        except OSError as error:
            raise SecurityError(
                f"the authority's certificate and key are needed: {error.filename}: {error.strerror}"
            ) from error
        except ValueError as error:
            raise SecurityError(f"the authority in {self.path} is damaged: {error}") from error

    def _write_pair(self, name: str, issued: Issued) -> None:
        write_atomically(self.path / f"{name}.pem", [issued.certificate], PUBLIC)
        write_atomically(self.path / f"{name}.key", [issued.key], PRIVATE)

    def _save(self, table: Table) -> None:
        self.table = table
        mark(self.path)
        configuration = _json(self.router_configuration())
        write_atomically(self.path / TABLE, [_json(table.document())], PUBLIC)
        write_atomically(self.router_file, [configuration], PUBLIC)

    @contextmanager
    def _changing(self) -> Iterator[None]:
        """Lock the folder and read its table again, so that concurrent changes are not lost."""
        with exclusive_lock(self.path):
            self.table = type(self).open(self.path).table
            _ = self.listen  # a file that cannot be read is refused before anything changes
            yield


def _reader_file(site: str) -> str:
    """Return the name of the files of the reader of one site."""
    return f"{READER}-{file_name_of(site)}"


def _json(document: Any) -> bytes:
    return json.dumps(document, indent=2, ensure_ascii=False).encode() + b"\n"
