"""Storage: the values that 0x1010 keeps over power-off, 0x1011 drops, and a reset takes (CiA 301, 7.5.2.13 and .14)."""

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
    """What a device keeps over power-off in its `store`; without one, until the program ends.

    `values` are the stored ones that can be used. `refused` has a sentence for each of the others, until the device
    stores again.
    """

    def __init__(self, dictionary: Dictionary, store: Store | None, lss: LssSlave | None) -> None:
        self._own, self._store, self._lss = dictionary.device.node_id_address, store, lss
        if lss:
            lss.store = self._store_commissioning
        self.refused: tuple[str, ...] = ()
        values: dict[Address, Value] = {}
        try:
            values |= store.load() if store else {}
        except DamagedFile as error:
            self.refused = (f"{error}; the defaults are taken",)
        # One by one: if a newer file has narrowed one range, all other stored values must survive.
        wrong = dict(refused(dictionary, values))
        self.refused += tuple(f"stored value refused: {what}" for what in wrong.values())
        self.values = {address: value for address, value in values.items() if address not in wrong}

    def after(self, command: NmtCommand, objects: Objects) -> dict[Address, Value]:
        """Return the values after a reset: the stored ones, but a new node-ID takes effect now (CiA 301, 7.3.2.2.3)."""
        values = dict(self.values)
        if command is NmtCommand.RESET_COMMUNICATION:
            # Only 0x1000 to 0x1FFF go back to what was stored; the application keeps its parameters as they are.
            values = {a: value for a, value in values.items() if a[0] in COMMUNICATION_PROFILE}
            values |= {a: v for a, v in objects.values.items() if a[0] not in COMMUNICATION_PROFILE}
        if self._own:
            values[self._own] = objects.value(self._own)
        return values

    def write(
        self, objects: Objects, emergencies: Emergencies, node_id: int, address: Address, signature: Value
    ) -> None:
        """Write 0x1010 or 0x1011: store the present values, or restore the file's from the next reset on."""
        # Spelt out, as `save` and `load`, so that no stray write stores or restores anything.
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
        # The values refused at the start have been overwritten: there is nothing left to complain about.
        self.values, self.refused = values, ()
        emergencies.cleared(Store)
        if self._own and address[0] == standard.RESTORE:
            objects.values.pop(self._own, None)  # a reset keeps the present node-ID

    def _store_commissioning(self, commissioning: Commissioning) -> bool:
        """Store node-ID and bit rate beside the values that are stored already; return whether that was possible."""
        try:
            if self._store:
                self._store.save(self.values, *commissioning)
        except (OSError, DictionaryError):
            return False
        return True
