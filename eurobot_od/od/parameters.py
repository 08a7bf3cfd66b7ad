"""Classification of a device's objects into settings and process data."""

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
    """The settings of a device: objects that are configured, stored, and written to a DCF.

    Settings may be mapped into PDOs; `process_data`, commands and histories are not settings.
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
        """Process data by the device profile (CiA 401, CiA 402), or by the mappings of valid PDOs.

        All objects in RPDOs are process data; in TPDOs only those with access `rwr`, as a master may set others.
        """
        found = set()
        for pdo in self._pdo_reader.pdos(unheard, listening=True):
            if not pdo.valid:
                continue
            for each in pdo.mapping:
                if pdo.direction is PdoDirection.RPDO or each.variable.access_type == "rwr":
                    part = part_of(self._objects, each.variable)
                    found |= {each.address, part.whole if part else each.address}
        of_profile = PROCESS_DATA.get(profile_of(self._objects), {})
        for index, entry in self._objects.indices.items():
            subs = of_profile.get(cia402.on_first_axis(index), ()) if index not in values.DUMMIES else ()
            found |= {(index, sub) for sub in od.members_of(entry) if sub in subs}
        return frozenset(found)
