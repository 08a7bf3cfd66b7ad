"""A simulated I/O module: a device from its file whose inputs and outputs behave as CiA 401 says.

Rule of this file: it only connects. What an input or output does stands in `profiles.inputs_outputs`.
"""

from __future__ import annotations

from collections.abc import Callable
from functools import partial
from typing import Any

from eurobot_od.device.bound import Application
from eurobot_od.device.device_values import DeviceValues, ProfileDevice
from eurobot_od.device.profiles.inputs_outputs import Inputs, Outputs
from eurobot_od.device.waveforms import fitted
from eurobot_od.frame import Frame
from eurobot_od.od.dictionary import Dictionary
from eurobot_od.od.objects import data_type
from eurobot_od.od.profiles import cia401
from eurobot_od.od.values import Address, DataType, Value
from eurobot_od.pdo.binding import Binding


class SimulatedModule(ProfileDevice):
    """An I/O module of CiA 401, made from its EDS or DCF.

    Waveforms are what is on the terminals of its inputs, `outputs` what is on those of its outputs: by polarity and
    filter, and with the error values if a heartbeat is lost, the bus is lost or the module is stopped. A TPDO with
    inputs goes on a change if one of the inputs may cause it (interrupt masks, limits and deltas).
    """

    def __init__(self, dictionary: Dictionary, **options: Any) -> None:
        self._values = DeviceValues(self)
        self._inputs: Inputs | None = None
        self._begun = False
        super().__init__(dictionary, **options)

    @property
    def outputs(self) -> dict[Address, int]:
        """What is on the terminals of its outputs, by the objects that command them."""
        return dict(self._outputs.terminals)

    def _application(self, dictionary: Dictionary) -> Application:
        application = super()._application(dictionary)
        kinds = (*cia401.DIGITAL_INPUTS, *cia401.ANALOGUE_INPUTS)
        subs = ((kind.value, sub) for kind in kinds for sub in dictionary.members.get(kind.value, ()) if sub)
        # On the terminal of an input is what a waveform says, or what it was given.
        ends = dict[Address, Callable[[], Value]]((each, partial(self._kept, each)) for each in subs)
        ends |= application.measured
        types = {each: data_type(self._variable(each)) for each in ends}
        return application._replace(
            measured={each: partial(self._input, each, types[each], read) for each, read in ends.items()}
        )

    def _kept(self, address: Address) -> Value:
        return self.device.objects.kept(address)

    def _input(self, address: Address, type_: DataType, read: Callable[[], Value]) -> Value:
        terminals = read()
        if self._inputs is None or not isinstance(terminals, int):
            return terminals
        return fitted(self._inputs.value(address, terminals, self.now), type_)

    def reset(self) -> None:
        """Begin anew: outputs as the file's defaults, no input has changed."""
        self._inputs, self._outputs, self._begun = Inputs(self._values), Outputs(self._values), False
        super().reset()

    # What is sent

    def _changed(self) -> list[Frame]:
        self.device.settle()
        operational = self.device.operational
        if operational and not self._begun:
            self._outputs.failed = False
        self._outputs.refresh()
        inputs, caused = self._inputs, set[Address]()
        if inputs is not None and operational:
            if not self._begun:
                inputs.forget()
            caused = inputs.caused({address: self.device.objects.raw(address) for address in inputs.addresses})
        # Each TPDO goes once when it may go for the first time, whatever causes it later (CiA 301, 7.2.2.4).
        allowed = None if operational and not self._begun else partial(self._may_go, caused)
        self._begun = operational
        return self.outgoing(self.device.changed(self.now, allowed))

    def _may_go(self, caused: set[Address], binding: Binding) -> bool:
        mapped = {each.address for each in binding.pdo.mapping}
        inputs = mapped & self._inputs.addresses if self._inputs else set()
        return not inputs or bool(inputs & caused)

    # Errors

    def _connection_lost(self) -> None:
        """Give the outputs their error values, as the error modes say (CiA 401-1, objects 0x6206 and 0x6443)."""
        self._outputs.fail()
