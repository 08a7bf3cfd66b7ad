"""`new-device` writes the files of a new device, or a device package for one with an EDS."""

from __future__ import annotations

import re
from keyword import iskeyword
from pathlib import Path
from typing import Annotated

from eurobot_od.cli.signature import Option
from eurobot_od.device.profiles import SimulatedDrive, SimulatedModule, simulated_kind
from eurobot_od.errors import LocalError
from eurobot_od.od.dictionary import Dictionary
from eurobot_od.od.identity import Identity
from eurobot_od.od.make.device import device_eds, read_device_table
from eurobot_od.od.objects import all_objects, limits
from eurobot_od.od.units import RAW, scale_of
from eurobot_od.od.values import label
from eurobot_od.support.files import check_new_folder, read_whole, write_whole

FILES = Path(__file__).with_name("new_device_files")
"""Folder of the templates of a device package; the suffix `.new` keeps them from being part of this package."""

SUFFIX = ".new"
DEVICE_FILES = FILES / "device"
"""Folder of the templates of a new device; NAME in names and texts is replaced."""

WORKFLOWS = Path(".github", "workflows")
INSIDE = ("device.py", "device.yaml")
"""Files in the package's folder of modules."""


def new_device(
    folder: Annotated[Path, Option(metavar="FOLDER")],
    *,
    package: bool = False,
    eds: Annotated[Path | None, Option(metavar="FILE", is_file=True)] = None,
) -> None:
    """Write a new device: its table and EDS, a suite, a workflow for CI, a README with what to type; or a package.

    A device package works at once: words, units, decoder, watcher, steps, simulated device, its test.

    Raises LocalError, DictionaryError, OSError.

    folder: where it goes, and what it is called: a new folder, or an empty one
    package: a package for a device that has an EDS; `pip install .` installs it
    eds: with --package: the device's EDS, whose identity (0x1018) the package is for

    $ new-device thermometer
    $ new-device gripper --package --eds servo.eds
    """
    if package != (eds is not None):
        raise LocalError("a device package needs the device's EDS: write new-device NAME --package --eds FILE")
    check_new_folder(folder)
    name = folder.resolve().name
    module = re.sub(r"\W+", "_", name.lower()).strip("_")
    if not module.isidentifier() or iskeyword(module) or not module.isascii():
        raise LocalError(f"{name}: its name begins with a letter and is not a word of Python")
    if eds is None:
        _write_device(folder, name)
        return
    files = {folder / path: text for path, text in _texts(name, module, Dictionary.load(eds, 5)).items()}
    files[folder / module / "__init__.py"] = f'"""{name}, a device package for eurobot-od."""\n'
    for file, text in files.items():
        file.parent.mkdir(parents=True, exist_ok=True)
        write_whole(file, text.encode())
    write_whole(folder / module / eds.name, read_whole(eds))
    print(*files, sep="\n")  # last, as a closed pipe ends the program
    print("\ntry it:", f"cd {folder}", "pip install -e . pytest", "python -m pytest", sep="\n  ")


def _write_device(folder: Path, name: str) -> None:
    """Write the files of a new device."""
    for file in sorted(DEVICE_FILES.glob(f"*{SUFFIX}")):
        plain_name = file.name.removesuffix(SUFFIX).replace("NAME", name)
        path = folder / WORKFLOWS / plain_name if plain_name == "check.yml" else folder / plain_name
        path.parent.mkdir(parents=True, exist_ok=True)
        write_whole(path, file.read_text(encoding="utf-8").replace("NAME", name).encode())
        print(path)
    table = folder / f"{name}.yaml"
    made = folder / f"{name}.eds"
    write_whole(made, device_eds(read_device_table(table.read_text(encoding="utf-8"), str(table)), made.name))
    print(made)
    print("\ntry it:", f"cd {folder}", f"canopen-workbench check {name}.check.yaml --simulate", sep="\n  ")


def _texts(name: str, module: str, device: Dictionary) -> dict[str, str]:
    """Return the files of a package, by path."""
    kind = simulated_kind(device, None)
    numbers = [each for each in all_objects(device.objects) if each.index >= 0x2000 and limits(each)]
    if not numbers:
        raise LocalError(f"{device.file}: it has no number of its own (0x2000 and above) to give a unit")
    example = next((each for each in numbers if scale_of(each) == RAW), numbers[0])
    at = label((example.index, example.subindex))
    vendor, product, *_ = Identity.of(device)
    words = {
        "KIND_MODULE": "profiles" if issubclass(kind, (SimulatedDrive, SimulatedModule)) else "simulated",
        "KIND": kind.__name__,
        "PACKAGE": module,
        "NAME": name,
        "VENDOR": f"0x{vendor:X}",
        "PRODUCT": f"0x{product:X}",
        "EDS_FILE": device.file.name,
        "EXAMPLE_OBJECT": at,
        "EXAMPLE_UNITS": f"  {at}: {{unit: digits, factor: 1}}  # {example.qualname}",
    }
    found = re.compile("|".join(map(re.escape, words)))
    texts = {}
    for file in sorted(FILES.glob(f"*{SUFFIX}")):
        plain_name = file.name.removesuffix(SUFFIX)
        home = f"{module}/" if plain_name in INSIDE else ""
        if plain_name.startswith("test_"):
            home = "tests/"
        texts[f"{home}{plain_name}"] = found.sub(lambda each: words[each[0]], file.read_text(encoding="utf-8"))
    return texts
