"""The table of rules: what can be wrong on any CANopen bus. `docs/diagnosis-rules.md` is made from it."""

from __future__ import annotations

from eurobot_od.lint.findings import Severity
from eurobot_od.traffic.diagnosis.incidents import IncidentRule

E, W, I = Severity.ERROR, Severity.WARNING, Severity.INFO  # noqa: E741  # as the codes of `lint` begin


class BusRule(IncidentRule):
    """The rules for any bus: level, what must not be, likely cause, remedy, clause."""

    # The wire and the log
    BUS_OFF = (E, "A controller is bus-off: it takes no part in the bus any more",
        "a short circuit, a wrong bit rate or a missing terminator made too many transmissions fail",
        "measure 60 ohm between CAN_H and CAN_L, compare the bit rates, then restart the controller",
        "ISO 11898-1, 12.1")  # fmt: skip
    BUS_SILENT = (E, "No frame comes at all",
        "the adapter is not connected, has another bit rate than the bus, or no node has power",
        "`doctor` lists adapters; compare the bit rates, measure 60 ohm between CAN_H and CAN_L", "ISO 11898-1",
    )  # fmt: skip
    ERROR_FRAME = (E, "Frames are destroyed by errors on the wire",
        "a missing or third terminator, a loose plug, a wrong bit rate, nobody who acknowledges, or two "
        "nodes that send the same identifier with other data",
        "measure 60 ohm between CAN_H and CAN_L, compare the bit rates, unplug one node after the other",
        "ISO 11898-1, 10.11")  # fmt: skip
    FRAMES_MISSED = (W, "Frames came that could not be taken in",
        "this computer was too slow for the bus, or did something else", "record to a file, and diagnose that",
        "this program")  # fmt: skip
    LOG_GAP = (W, "Nothing at all comes for longer than the heartbeats allow",
        "the recording, or the whole bus, was interrupted", "look at the recorder, then at the supply of the bus",
        "CiA 301, 7.2.8.2.2")  # fmt: skip
    LOG_BACKWARDS = (
        W, "Time runs backwards in the log", "two recordings in one file, or the clock of the recorder was set",
        "cut the log there: times across it mean nothing", "the log")  # fmt: skip
    LOG_UNREADABLE = (W, "A line of the log cannot be read", "the file is damaged, cut off, or has another format",
        "record it again, or name its format by --format", "the log")  # fmt: skip
    LOAD_HIGH = (W, "The bus carries more than 80 % in a second",
        "messages are sent too often; urgent ones are still in time, the others wait",
        "raise inhibit times and event timers, or the bit rate; `load` computes what is late; -b says the bit rate",
        "CiA 301, 7.5.2.37 (inhibit time)")  # fmt: skip
    LOAD_BURST = (
        I, "The bus is full for 50 ms, though not for a second", "many messages fall due at once, as after a SYNC",
        "spread event timers, or answers to SYNC, over time", "CiA 301, 7.5.2.37 (inhibit time)")  # fmt: skip
    CAN_STARVE = (W, "A message can be later than its deadline, by its period and those of the more urgent ones",
        "the bus is too slow for what is promised on it", "`load` says what holds it up",
        "Davis, Burns, Bril, Lukkien 2007")  # fmt: skip

    # Nodes: boot-up and NMT
    TWO_NODES = (E, "Two nodes have the same node-ID",
        "two devices are set to it by switches, LSS or a copied configuration",
        "unplug one: the node-ID still answers? Give one of them another node-ID", "CiA 301, 7.3.3")  # fmt: skip
    NEVER_HEARD = (E, "A device that has a file is never heard",
        "it has no power, another bit rate or node-ID, or is not connected",
        "`scan` lists who is there; then look at supply, plug, bit rate and node-ID", "CiA 301, 7.3.2.2.1")  # fmt: skip
    NO_BOOT = (E, "A node does not boot up after a reset",
        "it hangs in its start, or was given another node-ID or bit rate",
        "switch its power off and on; look for its boot-up at other node-IDs", "CiA 301, 7.2.8.3.3")  # fmt: skip
    BOOTS_OPERATIONAL = (E, "A node boots up in the middle of its work",
        "its power broke down, its watchdog bit, or its program crashed",
        "look at its supply under load, then at its memory of errors (`emcy`)", "CiA 301, 7.2.8.3.3")  # fmt: skip
    BOOTS_AGAIN = (
        W, "A node boots up again without a command", "its power is not stable yet, or it starts anew by itself",
        "look at its supply; a device may say why (`emcy`)", "CiA 301, 7.2.8.3.3")  # fmt: skip
    NOT_FOLLOWED = (E, "A node is in another NMT state than it was told",
        "it was still booting, refuses because of an error, or a second master commands it",
        "wait for its boot-up before the command; read 0x1001 and its errors (`emcy`)", "CiA 301, 7.3.2.2")  # fmt: skip
    STATE_UNTOLD = (W, "A node changes its NMT state without a command",
        "its error behaviour after a lost heartbeat or bus-off (0x1029), a start by itself (0x1F80), or a log that "
        "lacks what its own computer sent", "look at its errors (`emcy`), and at whom it waits for (0x1016)",
        "CiA 301, 7.3.2.2, 7.5.2.32")  # fmt: skip
    NOT_STARTED = (W, "A node stays in PRE-OPERATIONAL: it sends no PDO",
        "no master starts it, and it does not start by itself (0x1F80)",
        "`nmt NODE start`, or `boot` for the whole network", "CiA 301, 7.3.2.2.1; CiA 302-2")  # fmt: skip

    # Error control
    HEARTBEAT_LOST = (
        E, "A heartbeat stays away for more than two periods", "the node has no power, hangs, or was unplugged",
        "look at its supply and plug; the frames before may say why", "CiA 301, 7.2.8.2.2.2")  # fmt: skip
    HEARTBEAT_LATE = (
        W, "A heartbeat is late by more than half its period", "the node is busy, or the bus is full at that time",
        "look at the load there; give the consumer at least twice the period", "CiA 301, 7.2.8.2.2.2")  # fmt: skip
    HEARTBEAT_CHANGED = (W, "Heartbeats come at another period than configured",
        "the node has other settings than its file, or was set by somebody before",
        "`read NODE 0x1017`, or let `boot` write it", "CiA 301, 7.5.2.20")  # fmt: skip
    CONSUMER_UNFED = (E, "A node waits for a heartbeat that nobody sends",
        "the producer has no heartbeat time (0x1017), or is not there",
        "write 0x1017 of the producer, or take the entry out of 0x1016", "CiA 301, 7.5.2.19")  # fmt: skip
    CONSUMER_SHORT = (E, "A node waits less for a heartbeat than its producer's period",
        "0x1016 of the one and 0x1017 of the other were set apart", "set 0x1016 to at least twice 0x1017",
        "CiA 301, 7.5.2.19")  # fmt: skip
    GUARD_TOGGLE = (E, "An answer to node guarding has the toggle bit of the one before",
        "the node repeats its answer, lost one, or there are two guarding masters",
        "use heartbeats; or leave one master that guards", "CiA 301, 7.2.8.3.2.1")  # fmt: skip
    GUARD_UNANSWERED = (E, "Node guarding gets no answer", "the node is not there, or has a heartbeat instead (0x1017)",
        "use its heartbeat; guarding and heartbeat exclude each other", "CiA 301, 7.2.8.2.2")  # fmt: skip

    # SDO
    TWO_CLIENTS = (E, "Two masters use one SDO channel",
        "two programs, or a program and a tool, ask the same node at the same time",
        "stop one; a second client needs a channel of its own (0x1201)", "CiA 301, 7.2.4.1")  # fmt: skip
    SDO_UNANSWERED = (E, "An SDO request gets no answer",
        "the node is not there, is stopped, or has its SDO server elsewhere (0x1200)",
        "`scan` lists who answers; look at the node's NMT state", "CiA 301, 7.2.4.3, 7.3.2.2.4")  # fmt: skip
    SDO_BROKEN = (E, "An SDO transfer breaks off", "its client gave it up, the node booted, or frames were lost",
        "look at the frames before; a longer timeout helps a slow device", "CiA 301, 7.2.4.3")  # fmt: skip
    SDO_TOGGLE = (E, "A segment of an SDO transfer has the wrong toggle bit", "a frame was lost, or sent twice",
        "look for errors on the wire, and for a second master", "CiA 301, 7.2.4.3.4, 7.2.4.3.7")  # fmt: skip
    SDO_UNASKED = (
        W, "An SDO answer comes without a request", "two nodes have the node-ID, or the node answered too late",
        "compare the times; a longer timeout helps a slow device", "CiA 301, 7.2.4.3")  # fmt: skip
    SDO_ABORT = (W, "A node refuses an SDO request", "as the abort code's words say",
        "compare the request with the device's file", "CiA 301, 7.2.4.3.17")  # fmt: skip

    SDO_PROBED = (
        I, "A node is asked for an object that it does not have", "a tool tries what the device can do, or has another "
        "version of its file", "nothing, if the tool goes on", "CiA 301, 7.2.4.3.17")  # fmt: skip

    # Configuration
    NOT_CONFIGURED = (
        W, "A node is started without all the values of its DCF", "the master writes only a part, or another file",
        "`configure NODE DCF` writes and verifies all of it", "CiA 302-2, boot slave; CiA 306")  # fmt: skip
    CONFIGURED_OTHERWISE = (
        W, "A node is given another value than its DCF has", "the master has another version of the file",
        "give master and diagnosis the same file; `diff` compares a node with it", "CiA 306")  # fmt: skip
    LSS_LEFT = (W, "A device is left in LSS configuration state", "the tool was ended in the middle",
        "switch all devices back to waiting: `lss find` does, or a reset of power", "CiA 305, switch state global",
    )  # fmt: skip

    # PDO
    COB_ID_SHARED = (
        E, "Two devices send PDOs with one COB-ID", "a copied configuration: the COB-ID is not made of the node-ID",
        "give one of them another COB-ID (0x1800 and up, sub-index 1)", "CiA 301, 7.5.2.37")  # fmt: skip
    PDO_LENGTH = (E, "A PDO has a length that its mapping in force cannot have",
        "the device is mapped otherwise than its file says, or another device sends it",
        "`pdo NODE` or `monitor --ask` shows how it is mapped", "CiA 301, 7.5.2.36, 7.5.2.38")  # fmt: skip
    ANSWER_MISSING = (E, "A message that asks gets no answer, though the network file promises one",
        "the node that answers is not there, not OPERATIONAL, or did not understand the question",
        "look at that node's state and errors; then compare both ends' files", "the network file: `answers`",
    )  # fmt: skip
    ANSWER_LATE = (W, "An answer comes later than computed for a bus that works",
        "its node is busy, or a message of lower identifier floods the bus",
        "compare with `decode --statistics` and `load`", "Davis, Burns, Bril, Lukkien 2007")  # fmt: skip
    PDO_STATE = (E, "A node sends a PDO outside of OPERATIONAL",
        "the device does not heed its NMT state, or two have the node-ID", "tell its maker", "CiA 301, 7.3.2.2.4",
    )  # fmt: skip
    PDO_INHIBIT = (W, "A PDO comes faster than its inhibit time allows",
        "the device has another inhibit time than its file, or two send it", "`pdo NODE` shows the time in force",
        "CiA 301, 7.5.2.37")  # fmt: skip
    PDO_TIMER = (W, "A PDO does not come within its event timer",
        "the device has another event timer than its file, or is too busy", "`pdo NODE` shows the timer in force",
        "CiA 301, 7.5.2.37")  # fmt: skip
    PDO_NO_SYNC = (E, "A synchronous PDO waits for a SYNC that nobody sends",
        "no producer of SYNC is started (0x1005 bit 30, 0x1006)",
        "let the master send SYNC (`sync`), or make the PDO event-driven (transmission type 255)",
        "CiA 301, 7.2.2.2")  # fmt: skip
    PDO_NOT_SENT = (W, "A synchronous PDO is not sent, though SYNC comes",
        "the PDO is not valid in the device, or has another COB-ID", "`pdo NODE` shows what is in force",
        "CiA 301, 7.2.2.2")  # fmt: skip
    PDO_UNKNOWN = (
        W, "An identifier is in no file", "a file is missing, or a device is mapped otherwise than its file says",
        "name the device's file by --eds; `scan` lists who is there", "CiA 301, 7.3.3")  # fmt: skip
    PDO_OFF = (W, "A PDO is sent that is switched off in its file", "the device was configured since",
        "`pdo NODE` shows what is in force", "CiA 301, 7.5.2.37")  # fmt: skip
    OUT_OF_RANGE = (W, "A value in a PDO is outside the limits of its object",
        "a wrong unit or byte order at the sender, or a wrong file", "compare both ends' files",
        "CiA 306, LowLimit and HighLimit")  # fmt: skip
    FRAME_LENGTH = (E, "A frame of a service has a length that it cannot have",
        "something else is sent under a reserved identifier", "give that message another identifier",
        "CiA 301, 7.3.5")  # fmt: skip
    PDO_MAPPED_OTHERWISE = (I, "A PDO is mapped otherwise than its file says", "a master has mapped it",
        "nothing, if it was meant; a DCF can say so", "CiA 301, 7.5.2.38")  # fmt: skip
    PDO_UNHEARD = (I, "A PDO is sent that no file of the network receives",
        "its receiver has no file here, or is mapped otherwise", "nothing, if a master without a file takes it",
        "CiA 301, 7.2.2.1")  # fmt: skip

    # SYNC and TIME
    SYNC_TWO = (
        E, "Two producers send SYNC", "two devices have bit 30 of 0x1005 set, or a tool sends it beside the master",
        "leave one: clear bit 30 of 0x1005 in the other", "CiA 301, 7.2.5.1")  # fmt: skip
    SYNC_COUNTER = (E, "The counter in SYNC leaves out a number", "a SYNC was lost, or the producer started anew",
        "look for errors on the wire, and at the producer", "CiA 301, 7.2.5.3, 7.5.2.22")  # fmt: skip
    SYNC_JITTER = (W, "SYNC comes more than a quarter of its period early or late",
        "its producer is busy, or runs on a computer without real time",
        "let a device produce SYNC, or the driver send it cyclically", "CiA 301, 7.2.5.3")  # fmt: skip
    TIME_JUMPS = (W, "TIME does not go on as fast as the clock of the log",
        "two producers, or the clock of the producer was set", "leave one producer (bit 30 of 0x1012)",
        "CiA 301, 7.2.6")  # fmt: skip

    # EMCY
    EMCY_RAISED = (E, "A node reports an error and does not take it back",
        "as the error's words say; the register says of which kind",
        "`emcy NODE` lists its errors; the device's manual has the codes from 0xFF00 on", "CiA 301, 7.2.7")  # fmt: skip
    EMCY_STORM = (
        W, "A node sends more than 10 emergencies in a second", "an error comes and goes, or has no inhibit time",
        "set 0x1015 of the node; then look for what comes and goes", "CiA 301, 7.5.2.18")  # fmt: skip
    EMCY_REGISTER = (W, "An emergency has an error register without the generic error",
        "the device does not keep 0x1001 as it must", "tell its maker; do not trust its 0x1001", "CiA 301, 7.5.2.2",
    )  # fmt: skip
    EMCY_CLEARED = (I, "A node reports an error and takes it back", "as the error's words say",
        "nothing, if it does not come again", "CiA 301, 7.2.7")  # fmt: skip

    @property
    def stage(self) -> int:
        return 2 if self.name.startswith("EMCY") else 0
