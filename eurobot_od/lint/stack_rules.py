"""Rules about the object dictionary that a stack is compiled with: `lint --for canopennode`.

They are the needs of CANopenNode 4 in its default configuration; with parts of the stack switched off it needs less.
"""

from __future__ import annotations

from collections.abc import Mapping

from eurobot_od.lint.findings import Rules, Violations
from eurobot_od.lint.model import TOP, LintedDevice
from eurobot_od.od import standard, values

RULES = Rules()

NEEDED: Mapping[tuple[int, int], str] = {
    standard.DEVICE_TYPE: "Device type, UNSIGNED32, ro",
    standard.ERROR_REGISTER: "Error register, UNSIGNED8, ro",
    standard.EMCY: "COB-ID EMCY, UNSIGNED32, rw, $NODEID+0x80",
    (standard.CONSUMED_HEARTBEATS, 1): "Consumer heartbeat time, UNSIGNED32, rw",
    standard.HEARTBEAT_TIME: "Producer heartbeat time, UNSIGNED16, rw",
    (standard.IDENTITY, 1): "Vendor-ID, UNSIGNED32, ro",
    (standard.IDENTITY, 2): "Product code, UNSIGNED32, ro",
    (standard.IDENTITY, 3): "Revision number, UNSIGNED32, ro",
    (standard.IDENTITY, 4): "Serial number, UNSIGNED32, ro",
}
"""Variables that the stack needs to compile, and how to add each."""

PARTNERS = {
    0x1005: (0x1006,),
    0x1300: (0x1301,),
    0x1301: (0x1381, 0x13FE, 0x13FF),
}
"""Objects that the stack uses together with others."""

NUMBERED = {
    "SDO server": standard.SDO_SERVERS,
    "SDO client": standard.SDO_CLIENTS,
    **{each.name: values.COMMUNICATION_RECORDS[each] for each in values.PdoDirection},
}
"""Services that the stack expects to be numbered without gaps."""

ADDED_BY_THE_STACK = (standard.EMCY[0], *standard.SDO_SERVERS, *values.PDO_PARAMETERS)
"""Objects to whose COB-IDs the stack adds the node-ID."""


@RULES.rule("E901", "public: CANopenNode, objectDictionary.md, requirements")
def missing(device: LintedDevice) -> Violations:
    """CANopenNode's default configuration has the objects that it compiles with."""
    for (index, sub), what in NEEDED.items():
        found = device.objects.get(index)
        if found is None or found.variable(sub) is None:
            yield found.place if found else TOP, f"CANopenNode needs {values.label((index, sub))}; add: {what}"


@RULES.rule("E902", "public: CANopenNode, CANopen.c")
def without_partner(device: LintedDevice) -> Violations:
    """An object that CANopenNode uses together with another one is not alone."""
    pdos = ((each.index, (each.mapping_index,)) for each in device.pdos)
    for index, others in (*PARTNERS.items(), *pdos):
        found = device.objects.get(index)
        for other in others:
            if found and other not in device.objects:
                yield found.place, f"with 0x{index:04X} CANopenNode needs 0x{other:04X}, too"


@RULES.rule("E903", "public: CANopenNode, CANopen.c")
def with_gap(device: LintedDevice) -> Violations:
    """PDOs, SDO servers and SDO clients are numbered from the first on: CANopenNode counts them through."""
    for name, records in NUMBERED.items():
        present = [each in device.objects for each in records]
        last = max((at for at, is_there in enumerate(present) if is_there), default=-1)
        gap = next((at for at in range(last) if not present[at]), None)
        if gap is not None:
            place = device.objects[records[last]].place
            yield place, f"{name} {last + 1} is there and {name} {gap + 1} (0x{records[gap]:04X}) is not; add it"


@RULES.rule("W904", "public: CANopenNode, CO_PDO.c, CO_Emergency.c, CO_SDOserver.c")
def node_id_of_a_value(device: LintedDevice) -> Violations:
    """A value with $NODEID is one to which CANopenNode adds the node-ID."""
    for each in device.given:
        if each.number and each.number.relative and each.variable.index not in ADDED_BY_THE_STACK:
            yield each.entry, f"CANopenNode does not add the node-ID to {each.variable.where}: your program has to"


OF_LINUX = {0x1010: "CO_CONFIG_STORAGE", 0x1011: "CO_CONFIG_STORAGE", 0x1280: "CO_CONFIG_GTW"}
"""Objects that CANopenLinux's program uses, and the macro that switches the part using them off."""


@RULES.rule("I905", "public: CANopenLinux, CO_main_basic.c")
def missing_on_linux(device: LintedDevice) -> Violations:
    """CANopenLinux's program with its default configuration has the objects that it uses."""
    for index, part in OF_LINUX.items():
        if index not in device.objects:
            yield TOP, f"CANopenLinux needs 0x{index:04X}, or to be compiled with -D{part}=0"


STACKS = {"canopennode": RULES}
"""Rules by stack."""
