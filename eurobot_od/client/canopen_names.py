"""Classes under the names that users of canopen know: `import eurobot_od as canopen` is all that their programs change.

Each is a face of what is here: `RemoteNode` is what `network.add` returns, `BaseNode402` is `drive402` with texts for
states and modes. A drive is commanded and asked by SDO, whatever the PDOs map. docs/python.md says what is different.
"""

from __future__ import annotations

from eurobot_od.client.remote_device import RemoteDevice
from eurobot_od.errors import DriveError, NoAnswer, NodeRefused, UnknownName
from eurobot_od.od import cia402
from eurobot_od.od.cia402 import MODE_WORDS, Mode, State

RemoteNode, SdoAbortedError, SdoCommunicationError = RemoteDevice, NodeRefused, NoAnswer

COMMANDED = {each.words.upper(): each for each in State} | {"DISABLE VOLTAGE": State.DISABLED}
"""The states by the words of canopen, which also has a command among them."""

MODES = {words.upper().replace("PROFILE ", "PROFILED "): Mode(mode) for mode, words in MODE_WORDS.items()}
"""The modes of operation by the words of canopen."""

HOMING_WAIT = 30.0
"""Seconds that `homing` takes at most by default."""


class BaseNode402(RemoteDevice):
    """A drive on a `Network`, with what canopen's class of this name has; `drive402` has the same with more checks."""

    def setup_402_state_machine(self, read_pdos: bool = True) -> None:
        """Ask the node how its PDOs are mapped now, unless not `read_pdos`; nothing else is needed."""
        self.pdo.read(from_od=not read_pdos)

    @property
    def powerstate_402(self) -> BaseNode402:
        """The node itself."""
        return self

    @property
    def statusword(self) -> int:
        """The statusword (0x6041)."""
        return self[cia402.STATUSWORD].read(int)

    def _set_controlword(self, word: int) -> None:
        self[cia402.CONTROLWORD].value = word

    controlword = property(fset=_set_controlword, doc="Set it to write the controlword (0x6040).")

    # The NMT state is `nmt.state`.
    @property  # type: ignore[override]
    def state(self) -> str:
        """The state of the drive, such as `OPERATION ENABLED`; `UNKNOWN` for a statusword that has none.

        Set it to bring the drive there, one arrow of its state machine after the other; `DISABLE VOLTAGE` may be set,
        too. Raises UnknownName, LocalError for a state that no command leads to, DriveError, NodeRefused, NoAnswer.
        """
        state = self.drive402.state
        return state.words.upper() if state else "UNKNOWN"

    @state.setter
    def state(self, wanted: str) -> None:
        if wanted not in COMMANDED:
            raise UnknownName("state of a drive", wanted, COMMANDED)
        if COMMANDED[wanted] is State.DISABLED:
            self.drive402.fault_reset()
        self.drive402.bring_to(COMMANDED[wanted])

    @property
    def op_mode(self) -> str:
        """The mode of operation, such as `PROFILED POSITION`; set it to change it. Raises UnknownName, DriveError."""
        shown = self[cia402.MODE_DISPLAY].read(int)
        return next((words for words, mode in MODES.items() if mode == shown), str(shown))

    @op_mode.setter
    def op_mode(self, words: str) -> None:
        if words not in MODES:
            raise UnknownName("mode of operation", words, MODES)
        self.drive402.choose(MODES[words])

    def is_op_mode_supported(self, words: str) -> bool:
        """Whether the drive says that it has a mode (0x6502)."""
        return MODES.get(words) in cia402.supported(self[cia402.SUPPORTED_MODES].read(int))

    def is_faulted(self) -> bool:
        """Whether it has a fault."""
        return self.drive402.state is State.FAULT

    def reset_from_fault(self) -> None:
        """Reset its fault, and enable it."""
        self.drive402.fault_reset()
        self.drive402.enable()

    def homing(self, timeout: float = HOMING_WAIT) -> bool:
        """Enable and home it by the method that is set; return whether it has found home."""
        try:
            self.drive402.home(within=timeout)
        except DriveError:
            return False
        return True
