"""Write the bill of materials of a release: CycloneDX in JSON."""

import uuid
from collections.abc import Iterable, Mapping
from datetime import UTC, datetime
from hashlib import sha256
from pathlib import Path

from cyclonedx.contrib.license.factories import LicenseFactory
from cyclonedx.model import HashAlgorithm, HashType
from cyclonedx.model.bom import Bom
from cyclonedx.model.component import Component, ComponentScope, ComponentType
from cyclonedx.model.license import LicenseAcknowledgement
from cyclonedx.output.json import JsonV1Dot6
from packageurl import PackageURL
from packaging.requirements import Requirement
from packaging.utils import canonicalize_name

from release.needs import Package, own

_licences = LicenseFactory()


def bill_of_materials(wheels: Mapping[str, Path], packages: Iterable[Package], version: str, time_s: int) -> str:
    """Return the document. The same arguments give the same text.

    wheels: our distributions by name. packages: what they need. time_s: since 1970, of the release.
    """
    ours = {name: _own_component(name, wheel, version) for name, wheel in wheels.items()}
    listed = list(packages)
    others = {one.name: _component(one) for one in listed}
    bom = Bom(components=[*ours.values(), *others.values()])
    bom.metadata.component = Component(
        name="dropanchor", version=version, type=ComponentType.APPLICATION, bom_ref="dropanchor"
    )
    bom.metadata.timestamp = datetime.fromtimestamp(time_s, UTC)
    bom.serial_number = uuid.uuid5(uuid.NAMESPACE_URL, "".join(_digest(wheel) for wheel in wheels.values()))
    bom.register_dependency(bom.metadata.component, ours.values())
    known = ours | others
    for name, component in ours.items():
        bom.register_dependency(component, [known[needed] for needed in _needs_of_ours(name)])
    for one in listed:
        bom.register_dependency(others[one.name], [known[needed] for needed in sorted(one.needs)])
    return JsonV1Dot6(bom).output_as_string(indent=2) + "\n"


def _own_component(name: str, wheel: Path, version: str) -> Component:
    return Component(
        name=name,
        version=version,
        type=ComponentType.LIBRARY,
        bom_ref=name,
        scope=ComponentScope.REQUIRED,
        licenses=[_licences.make_from_string("Apache-2.0", license_acknowledgement=LicenseAcknowledgement.DECLARED)],
        hashes=[HashType(alg=HashAlgorithm.SHA_256, content=_digest(wheel))],
        purl=PackageURL("pypi", name=name, version=version),
    )


def _component(package: Package) -> Component:
    """Return a package of others. It is optional where only an extra brings it."""
    return Component(
        name=package.name,
        version=package.version,
        type=ComponentType.LIBRARY,
        bom_ref=package.name,
        scope=ComponentScope.OPTIONAL if package.extras else ComponentScope.REQUIRED,
        licenses=[_licences.make_from_string(package.licence, license_acknowledgement=LicenseAcknowledgement.DECLARED)],
        purl=PackageURL("pypi", name=package.name, version=package.version),
    )


def _needs_of_ours(name: str) -> list[str]:
    return sorted(str(canonicalize_name(Requirement(line).name)) for line in own()[name]["dependencies"])


def _digest(file: Path) -> str:
    return sha256(file.read_bytes()).hexdigest()
