"""What a configuration writes: which objects of a device are settings, and which are process data."""

from __future__ import annotations

from functools import cached_property
from typing import TYPE_CHECKING

from eurobot_od.od import cia401, cia402, standard, values
from eurobot_od.od import objects as od
from eurobot_od.od.pdos import PdoReader, part_of, unheard
from eurobot_od.od.values import Address, PdoDirection
from eurobot_od.od.words import profile_of

if TYPE_CHECKING:
    from canopen.objectdictionary import ObjectDictionary

PROCESS_DATA = {cia401.PROFILE: cia401.PROCESS_DATA, cia402.PROFILE: cia402.PROCESS_DATA}


class Parameters:
    """The settings of a device: what a configuration writes, a device stores and a DCF of it has.

    A setting may be mapped into PDOs; what is not one is `process_data`, a command or a history.
    """

    def __init__(self, objects: ObjectDictionary, pdo_reader: PdoReader) -> None:
        self._objects, self._pdo_reader = objects, pdo_reader

    def __contains__(self, address: Address) -> bool:
        variable = od.variable_at(self._objects, address)
        if variable is None or not od.is_described(variable) or not variable.writable:
            return False
        return address[0] not in standard.NOT_PARAMETERS and address not in self.process_data

    @cached_property
    def process_data(self) -> frozenset[Address]:
        """What is process data by its profile (CiA 401, CiA 402), or by the mappings of the PDOs that are valid.

        An RPDO brings it; of what a TPDO carries, only `rwr` is not set by a master.
        """
        found = set()
        for pdo in self._pdo_reader.pdos(unheard, listening=True):
            for each in pdo.mapping if pdo.valid else ():
                if pdo.direction is PdoDirection.RPDO or each.variable.access_type == "rwr":
                    part = part_of(self._objects, each.variable)
                    found |= {each.address, part.whole if part else each.address}
        of_profile = PROCESS_DATA.get(profile_of(self._objects), {})
        for index, entry in self._objects.indices.items():
            subs = of_profile.get(cia402.on_first_axis(index), ()) if index not in values.DUMMIES else ()
            found |= {(index, sub) for sub in od.members_of(entry) if sub in subs}
        return frozenset(found)
