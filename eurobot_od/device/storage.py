"""Storage of values by 0x1010, their removal by 0x1011, and their use after a reset (CiA 301, 7.5.2.13 and .14)."""

from __future__ import annotations

from eurobot_od.device.broadcasts import Emergencies
from eurobot_od.device.lss import Commissioning, LssSlave
from eurobot_od.device.nmt import NmtCommand
from eurobot_od.device.objects import COMMUNICATION_PROFILE, Objects, Store, refused
from eurobot_od.errors import DamagedFile, DictionaryError
from eurobot_od.od import standard
from eurobot_od.od.dictionary import Dictionary
from eurobot_od.od.values import Address, Value
from eurobot_od.sdo.wire import Abort, Reason


class Storage:
    """Values that a device keeps over power-off in its `store`; without one, until the program ends.

    `values` are the usable stored ones. `refused` has a sentence for each of the others, until the device stores again.
    """

    def __init__(self, dictionary: Dictionary, store: Store | None, lss: LssSlave | None) -> None:
        self._own = dictionary.device.node_id_address
        self._store = store
        self._lss = lss
        if lss:
            lss.store = self._store_commissioning
        self.refused: tuple[str, ...] = ()
        values: dict[Address, Value] = {}
        try:
            values |= store.load() if store else {}
        except DamagedFile as error:
            self.refused = (f"{error}; the defaults are taken",)
        # One by one, so that a narrower range in a newer file affects only one value.
        wrong = dict(refused(dictionary, values))
        self.refused += tuple(f"stored value refused: {what}" for what in wrong.values())
        self.values = {address: value for address, value in values.items() if address not in wrong}

    def after(self, command: NmtCommand, objects: Objects) -> dict[Address, Value]:
        """Return the values after a reset: the stored ones, with a new node-ID in effect (CiA 301, 7.3.2.2.3)."""
        values = dict(self.values)
        if command is NmtCommand.RESET_COMMUNICATION:
            # Only 0x1000 to 0x1FFF are restored; the application's parameters are kept.
            values = {a: value for a, value in values.items() if a[0] in COMMUNICATION_PROFILE}
            values |= {a: v for a, v in objects.values.items() if a[0] not in COMMUNICATION_PROFILE}
        if self._own:
            values[self._own] = objects.value(self._own)
        return values

    def write(
        self, objects: Objects, emergencies: Emergencies, node_id: int, address: Address, signature: Value
    ) -> None:
        """Write 0x1010 or 0x1011: store the present values, or restore the file's at the next reset."""
        # The signature prevents accidental writes.
        if signature != int.from_bytes(standard.SIGNATURES[address[0]], "little"):
            raise Abort(Reason.SIGNATURE)
        values = objects.configuration() if address[0] == standard.STORE else {}
        try:
            if self._store and self._lss:
                self._store.save(values, *self._lss.stored)
            elif self._store:
                self._store.save(values, objects.number(self._own) if self._own else node_id)
        except (OSError, DictionaryError) as error:
            raise Abort(Reason.NOT_STORED, str(error)) from error
        # The refused values were overwritten.
        self.values = values
        self.refused = ()
        emergencies.cleared(Store)
        if self._own and address[0] == standard.RESTORE:
            objects.values.pop(self._own, None)  # a reset keeps the present node-ID

    def _store_commissioning(self, commissioning: Commissioning) -> bool:
        """Store node-ID and bit rate with the stored values; return whether that succeeded."""
        try:
            if self._store:
                self._store.save(self.values, *commissioning)
        except (OSError, DictionaryError):
            return False
        return True
