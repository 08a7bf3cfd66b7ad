"""Small devices with an identity, as files of a library."""

from __future__ import annotations

from pathlib import Path

from tests.eds_text import DEVICE_TYPE, pdo, record, variable

VENDOR, PRODUCT, OTHER_PRODUCT, REVISION = 0x29C, 0x1001, 0x1002, 0x0002_0003


LISTS = "[MandatoryObjects]\nSupportedObjects=2\n1=0x1000\n2=0x1018\n\n"


def device_text(
    vendor: int | None = VENDOR,
    product: int | None = PRODUCT,
    revision: int | None = REVISION,
    device_type: int | None = 0x0002_0192,
    name: str = "Speed",
) -> str:
    """An EDS with an identity and a TPDO1; None for what it does not say."""
    numbers = [None if each is None else f"0x{each:X}" for each in (vendor, product, revision)]
    identity = record(0x1018, "Identity", (0, "UNSIGNED8", "3"), *_subs(*numbers))
    type_ = DEVICE_TYPE.replace("DefaultValue=0\n", "" if device_type is None else f"DefaultValue={device_type}\n")
    info = "[DeviceInfo]\nVendorName=A Maker\nProductName=Axis\n\n"
    objects = variable("2000", name, "INTEGER16", "7") + variable("2001", f"{name} limit", "INTEGER16", "8")
    tpdo = pdo(0x1800, "0x20000010", cob_id="$NODEID+0x180", settings={5: "100"})
    return f"{LISTS}{info}{type_}{identity}{objects}{tpdo}"


def _subs(*numbers: str | None) -> list[tuple[int, str, str | None]]:
    return [(sub, "UNSIGNED32", each) for sub, each in enumerate(numbers, start=1)]


def library_of(folder: Path, **texts: str) -> Path:
    """Write device files, by their stems, into a folder; return it."""
    folder.mkdir(parents=True, exist_ok=True)
    for stem, text in texts.items():
        (folder / f"{stem}.eds").write_text(text)
    return folder
