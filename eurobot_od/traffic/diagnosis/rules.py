"""Table of rules for any CANopen bus; `docs/diagnosis-rules.md` is made from it."""

from __future__ import annotations

from collections.abc import Collection, Mapping

from eurobot_od.lint.findings import Severity
from eurobot_od.traffic.diagnosis.incidents import IncidentRule, RuleRow


class BusRule(IncidentRule):
    """The rules for any bus."""

    # What everything else hangs on
    NO_CANOPEN = RuleRow(
        Severity.ERROR,
        "Most frames at the identifiers of CANopen's services have another length than the services",
        cause="this bus speaks another protocol, as a car's does",
        remedy="`--dbc FILE` names the frames of another protocol; what is said of CANopen here means nothing",
        clause="CiA 301, 7.2.4.3, 7.2.7.1, 7.2.8.3.2",
    )
    OTHER_DEVICE = RuleRow(
        Severity.ERROR,
        "A device is another one than its file is for",
        cause="another device has the node-ID, or the file is of another version: what is said of its PDOs is not sure",
        remedy="give `--eds` the file of this device; `devices` lists known ones, `read NODE 0x1018:2` asks who it is",
        clause="CiA 301, 7.5.2.1, 7.5.2.21",
    )

    # The wire and the log
    BUS_OFF = RuleRow(
        Severity.ERROR,
        "A controller is bus-off: it takes no part in the bus any more",
        cause="a short circuit, a wrong bit rate or a missing terminator made too many transmissions fail",
        remedy="measure 60 ohm between CAN_H and CAN_L, compare the bit rates, then restart the controller",
        clause="ISO 11898-1, 12.1",
    )
    BUS_SILENT = RuleRow(
        Severity.ERROR,
        "No frame comes at all",
        cause="the adapter is not connected, has another bit rate than the bus, or no node has power",
        remedy="`doctor` lists adapters; compare the bit rates, measure 60 ohm between CAN_H and CAN_L",
        clause="ISO 11898-1",
    )
    ERROR_FRAME = RuleRow(
        Severity.ERROR,
        "Frames are destroyed by errors on the wire",
        cause=(
            "a missing or third terminator, a loose plug, a wrong bit rate, nobody who acknowledges, or two nodes "
            "that send the same identifier with other data"
        ),
        remedy="measure 60 ohm between CAN_H and CAN_L, compare the bit rates, unplug one node after the other",
        clause="ISO 11898-1, 10.11",
    )
    FRAMES_MISSED = RuleRow(
        Severity.WARNING,
        "Frames came that could not be taken in",
        cause="this computer was too slow for the bus, or did something else",
        remedy="record to a file, and diagnose that",
        clause="this program",
    )
    LOG_GAP = RuleRow(
        Severity.WARNING,
        "Nothing at all comes for longer than the heartbeats allow",
        cause="the recording, or the whole bus, was interrupted",
        remedy="look at the recorder, then at the supply of the bus",
        clause="CiA 301, 7.2.8.2.2",
    )
    LOG_BACKWARDS = RuleRow(
        Severity.WARNING,
        "Time runs backwards in the log",
        cause="two recordings in one file, or the clock of the recorder was set",
        remedy="cut the log there: times across it mean nothing",
        clause="the log",
    )
    LOG_DELTAS = RuleRow(
        Severity.INFO,
        "The times in the log seem to be differences, each from the frame before",
        cause="it was recorded so, as by candump -td",
        remedy="record it with absolute times (candump -L): what needs a time was not judged",
        clause="the log",
    )
    LOG_UNREADABLE = RuleRow(
        Severity.WARNING,
        "A line of the log cannot be read",
        cause="the file is damaged, cut off, or has another format",
        remedy="record it again, or name its format by --format",
        clause="the log",
    )
    LOAD_FULL = RuleRow(
        Severity.ERROR,
        "The bus is full: it carries more than 90 % in a second",
        cause="a message is sent without a pause; heartbeats and answers come late, or not at all",
        remedy=(
            "give that message an inhibit time, or an event timer (0x1800 and up, sub-indices 3 and 5); "
            "-b says the bit rate"
        ),
        clause="CiA 301, 7.5.2.37 (inhibit time)",
    )
    LOAD_HIGH = RuleRow(
        Severity.WARNING,
        "The bus carries more than 80 % in a second",
        cause="messages are sent too often; urgent ones are still in time, the others wait",
        remedy=(
            "raise inhibit times and event timers, or the bit rate; `load` computes what is late; -b says the bit rate"
        ),
        clause="CiA 301, 7.5.2.37 (inhibit time)",
    )
    LOAD_BURST = RuleRow(
        Severity.INFO,
        "The bus is full for 50 ms, though not for a second",
        cause="many messages fall due at once, as after a SYNC",
        remedy="spread event timers, or answers to SYNC, over time",
        clause="CiA 301, 7.5.2.37 (inhibit time)",
    )
    CAN_STARVE = RuleRow(
        Severity.WARNING,
        "A message can be later than its deadline, by its period and those of the more urgent ones",
        cause="the bus is too slow for what is promised on it",
        remedy="`load` says what holds it up",
        clause="Davis, Burns, Bril, Lukkien 2007",
    )

    # Nodes: boot-up and NMT
    TWO_NODES = RuleRow(
        Severity.ERROR,
        "Two nodes have the same node-ID",
        cause="two devices are set to it by switches, LSS or a copied configuration",
        remedy="ask for 0x1018 (`read NODE 0x1018:4`), unplug one, ask again: who answers? Give one another node-ID",
        clause="CiA 301, 7.3.3",
    )
    NEVER_HEARD = RuleRow(
        Severity.ERROR,
        "A device that has a file is never heard",
        cause="it has no power, another bit rate or node-ID, or is not connected",
        remedy="`scan` lists who is there; then look at supply, plug, bit rate and node-ID",
        clause="CiA 301, 7.3.2.2.1",
    )
    NO_BOOT = RuleRow(
        Severity.ERROR,
        "A node does not boot up after a reset",
        cause="it hangs in its start, or was given another node-ID or bit rate",
        remedy="switch its power off and on; look for its boot-up at other node-IDs",
        clause="CiA 301, 7.2.8.3.3",
    )
    BOOTS_OPERATIONAL = RuleRow(
        Severity.ERROR,
        "A node boots up in the middle of its work",
        cause="its power broke down, its watchdog bit, or its program crashed",
        remedy="look at its supply under load, then at its memory of errors (`emcy`)",
        clause="CiA 301, 7.2.8.3.3",
    )
    BOOTS_AGAIN = RuleRow(
        Severity.WARNING,
        "A node boots up again without a command",
        cause="its power is not stable yet, or it starts anew by itself",
        remedy="look at its supply; a device may say why (`emcy`)",
        clause="CiA 301, 7.2.8.3.3",
    )
    NOT_FOLLOWED = RuleRow(
        Severity.ERROR,
        "A node is in another NMT state than it was told",
        cause="it was still booting, refuses because of an error, or a second master commands it",
        remedy="wait for its boot-up before the command; read 0x1001 and its errors (`emcy`)",
        clause="CiA 301, 7.3.2.2",
    )
    STATE_UNTOLD = RuleRow(
        Severity.WARNING,
        "A node changes its NMT state without a command",
        cause=(
            "its error behaviour after a lost heartbeat or bus-off (0x1029), a start by itself (0x1F80), or a log "
            "that lacks what its own computer sent"
        ),
        remedy="look at its errors (`emcy`), and at whom it waits for (0x1016)",
        clause="CiA 301, 7.3.2.2, 7.5.2.32",
    )
    NOT_STARTED = RuleRow(
        Severity.WARNING,
        "A node stays in PRE-OPERATIONAL: it sends no PDO",
        cause="no master starts it, and it does not start by itself (0x1F80)",
        remedy="`nmt NODE start`, or `boot` for the whole network",
        clause="CiA 301, 7.3.2.2.1; CiA 302-2",
    )

    # Error control
    HEARTBEAT_LOST = RuleRow(
        Severity.ERROR,
        "A heartbeat stays away for more than two periods",
        cause="the node has no power, hangs, or was unplugged",
        remedy="look at its supply and plug; the frames before may say why",
        clause="CiA 301, 7.2.8.2.2.2",
    )
    HEARTBEAT_LATE = RuleRow(
        Severity.WARNING,
        "A heartbeat is late by more than half its period",
        cause="the node is busy, or the bus is full at that time",
        remedy="look at the load there; give the consumer at least twice the period",
        clause="CiA 301, 7.2.8.2.2.2",
    )
    HEARTBEAT_CHANGED = RuleRow(
        Severity.WARNING,
        "Heartbeats come at another period than configured",
        cause="the node has other settings than its file, or was set by somebody before",
        remedy="`read NODE 0x1017`, or let `boot` write it",
        clause="CiA 301, 7.5.2.20",
    )
    CONSUMER_UNFED = RuleRow(
        Severity.ERROR,
        "A node waits for a heartbeat that nobody sends",
        cause="the producer has no heartbeat time (0x1017), or is not there",
        remedy="write 0x1017 of the producer, or take the entry out of 0x1016",
        clause="CiA 301, 7.5.2.19",
    )
    CONSUMER_SHORT = RuleRow(
        Severity.ERROR,
        "A node waits less for a heartbeat than its producer's period",
        cause="0x1016 of the one and 0x1017 of the other were set apart",
        remedy="set 0x1016 to at least twice 0x1017",
        clause="CiA 301, 7.5.2.19",
    )
    GUARD_TOGGLE = RuleRow(
        Severity.ERROR,
        "An answer to node guarding has the toggle bit of the one before",
        cause="the node repeats its answer, lost one, or there are two guarding masters",
        remedy="use heartbeats; or leave one master that guards",
        clause="CiA 301, 7.2.8.3.2.1",
    )
    GUARD_UNANSWERED = RuleRow(
        Severity.ERROR,
        "Node guarding gets no answer",
        cause="the node is not there, or has a heartbeat instead (0x1017)",
        remedy="use its heartbeat; guarding and heartbeat exclude each other",
        clause="CiA 301, 7.2.8.2.2",
    )

    # SDO
    TWO_CLIENTS = RuleRow(
        Severity.ERROR,
        "Two masters use one SDO channel",
        cause="two programs, or a program and a tool, ask the same node at the same time",
        remedy="stop one; a second client needs a channel of its own (0x1201)",
        clause="CiA 301, 7.2.4.1",
    )
    SDO_UNANSWERED = RuleRow(
        Severity.ERROR,
        "An SDO request gets no answer",
        cause="the node is not there, is stopped, or has its SDO server elsewhere (0x1200)",
        remedy="`scan` lists who answers; look at the node's NMT state",
        clause="CiA 301, 7.2.4.3, 7.3.2.2.4",
    )
    ONE_DIRECTION = RuleRow(
        Severity.WARNING,
        "A log has only one direction of SDO",
        cause="the recorder does not take its own program's frames, or a filter leaves one direction out",
        remedy="record requests and answers: settings that a log does not show are taken from the files",
        clause="CiA 301, 7.2.4.2",
    )
    SDO_BROKEN = RuleRow(
        Severity.ERROR,
        "An SDO transfer breaks off",
        cause="its client gave it up, the node booted, or frames were lost",
        remedy="look at the frames before; a longer timeout helps a slow device",
        clause="CiA 301, 7.2.4.3",
    )
    SDO_TOGGLE = RuleRow(
        Severity.ERROR,
        "A segment of an SDO transfer has the wrong toggle bit",
        cause="a frame was lost, or sent twice",
        remedy="look for errors on the wire, and for a second master",
        clause="CiA 301, 7.2.4.3.4, 7.2.4.3.7",
    )
    SDO_UNASKED = RuleRow(
        Severity.WARNING,
        "An SDO answer comes without a request",
        cause="two nodes have the node-ID, or the node answered too late",
        remedy="compare the times; a longer timeout helps a slow device",
        clause="CiA 301, 7.2.4.3",
    )
    SDO_ABORT = RuleRow(
        Severity.WARNING,
        "A node refuses an SDO request",
        cause="as the abort code's words say",
        remedy="compare the request with the device's file",
        clause="CiA 301, 7.2.4.3.17",
    )

    SDO_PROBED = RuleRow(
        Severity.INFO,
        "A node is asked for an object that it does not have",
        cause="a tool tries what the device can do, or has another version of its file",
        remedy="nothing, if the tool goes on",
        clause="CiA 301, 7.2.4.3.17",
    )

    SDO_SCAN = RuleRow(
        Severity.INFO,
        "A tool looks who is there",
        cause="it asks all node-IDs, and most of them are not used",
        remedy="nothing: who is missing is an incident of its own if it has a file",
        clause="CiA 301, 7.2.4.3",
    )

    # Configuration
    NOT_CONFIGURED = RuleRow(
        Severity.WARNING,
        "A node is started without all the values of its DCF",
        cause="the master writes only a part, or another file",
        remedy="`configure NODE DCF` writes and verifies all of it",
        clause="CiA 302-2, boot slave; CiA 306",
    )
    CONFIGURED_OTHERWISE = RuleRow(
        Severity.WARNING,
        "A node is given another value than its DCF has",
        cause="the master has another version of the file",
        remedy="give master and diagnosis the same file; `diff` compares a node with it",
        clause="CiA 306",
    )
    LSS_LEFT = RuleRow(
        Severity.WARNING,
        "A device is left in LSS configuration state",
        cause="the tool was ended in the middle",
        remedy="switch all devices back to waiting: `lss find` does, or a reset of power",
        clause="CiA 305, switch state global",
    )

    # PDO
    COB_ID_SHARED = RuleRow(
        Severity.ERROR,
        "Two devices send PDOs with one COB-ID",
        cause="a copied configuration: the COB-ID is not made of the node-ID",
        remedy="give one of them another COB-ID (0x1800 and up, sub-index 1)",
        clause="CiA 301, 7.5.2.37",
    )
    PDO_LENGTH = RuleRow(
        Severity.ERROR,
        "A PDO has a length that its mapping in force cannot have",
        cause="the device is mapped otherwise than its file says, or another device sends it",
        remedy="`pdo NODE` or `monitor --ask` shows how it is mapped",
        clause="CiA 301, 7.5.2.36, 7.5.2.38",
    )
    ANSWER_MISSING = RuleRow(
        Severity.ERROR,
        "A message that asks gets no answer, though the network file promises one",
        cause="the node that answers is not there, not OPERATIONAL, or did not understand the question",
        remedy="look at that node's state and errors; then compare both ends' files",
        clause="the network file: `answers`",
    )
    ANSWER_LATE = RuleRow(
        Severity.WARNING,
        "An answer comes later than computed for a bus that works",
        cause="its node is busy, or a message of lower identifier floods the bus",
        remedy="compare with `decode --statistics` and `load`",
        clause="Davis, Burns, Bril, Lukkien 2007",
    )
    PDO_STATE = RuleRow(
        Severity.ERROR,
        "A node sends a PDO outside of OPERATIONAL",
        cause="the device does not heed its NMT state, or two have the node-ID",
        remedy="tell its maker",
        clause="CiA 301, 7.3.2.2.4",
    )
    PDO_INHIBIT = RuleRow(
        Severity.WARNING,
        "A PDO comes faster than its inhibit time allows",
        cause="the device has another inhibit time than its file, or two send it",
        remedy="`pdo NODE` shows the time in force",
        clause="CiA 301, 7.5.2.37",
    )
    PDO_TIMER = RuleRow(
        Severity.WARNING,
        "A PDO does not come within its event timer",
        cause="the device has another event timer than its file, or is too busy",
        remedy="`pdo NODE` shows the timer in force",
        clause="CiA 301, 7.5.2.37",
    )
    PDO_DEADLINE = RuleRow(
        Severity.ERROR,
        "A PDO is not refreshed as its receiver expects",
        cause="its sender was ended, hangs, or is slower than the receiver's event timer (0x1400 and up, sub-index 5)",
        remedy="look at its sender, often the master's program; or raise the receiver's event timer",
        clause="CiA 301, 7.5.2.35 (event timer of an RPDO), Table 26 (0x8250)",
    )
    PDO_NO_SYNC = RuleRow(
        Severity.ERROR,
        "A synchronous PDO waits for a SYNC that nobody sends",
        cause="no producer of SYNC is started (0x1005 bit 30, 0x1006)",
        remedy="let the master send SYNC (`sync`), or make the PDO event-driven (transmission type 255)",
        clause="CiA 301, 7.2.2.2",
    )
    PDO_NOT_SENT = RuleRow(
        Severity.WARNING,
        "A synchronous PDO is not sent, though SYNC comes",
        cause="the PDO is not valid in the device, or has another COB-ID",
        remedy="`pdo NODE` shows what is in force",
        clause="CiA 301, 7.2.2.2",
    )
    PDO_UNKNOWN = RuleRow(
        Severity.WARNING,
        "An identifier is in no file",
        cause="a file is missing, or a device is mapped otherwise than its file says",
        remedy="name the device's file by --eds, or your robot by --robot; `scan` lists who is there",
        clause="CiA 301, 7.3.3",
    )
    PDO_OFF = RuleRow(
        Severity.WARNING,
        "A PDO is sent that is switched off, or under an identifier that it has left",
        cause="the device was configured since, or another device sends it",
        remedy="`pdo NODE` shows what is in force",
        clause="CiA 301, 7.5.2.37",
    )
    PDO_MAPPING_UNKNOWN = RuleRow(
        Severity.WARNING,
        "A PDO is sent whose mapping the log does not have",
        cause="a master has mapped it before the log begins, or frames of that are missing",
        remedy="record from the boot-up on, or ask the device: `pdo NODE`, `monitor --ask`",
        clause="CiA 301, 7.5.2.38",
    )
    OUT_OF_RANGE = RuleRow(
        Severity.WARNING,
        "A value in a PDO is outside the limits of its object",
        cause="a wrong unit or byte order at the sender, or a wrong file",
        remedy="compare both ends' files",
        clause="CiA 306, LowLimit and HighLimit",
    )
    FRAME_LENGTH = RuleRow(
        Severity.ERROR,
        "A frame of a service has a length that it cannot have",
        cause="something else is sent under a reserved identifier",
        remedy="give that message another identifier",
        clause="CiA 301, 7.3.5",
    )
    PDO_MAPPED_OTHERWISE = RuleRow(
        Severity.INFO,
        "A PDO is mapped otherwise than its file says",
        cause="a master has mapped it",
        remedy="nothing, if it was meant; a DCF can say so",
        clause="CiA 301, 7.5.2.38",
    )
    PDO_UNHEARD = RuleRow(
        Severity.INFO,
        "A PDO is sent that no file of the network receives",
        cause="its receiver has no file here, or is mapped otherwise",
        remedy="nothing, if a master without a file takes it",
        clause="CiA 301, 7.2.2.1",
    )

    # Drives
    DRIVE_FAULT = RuleRow(
        Severity.ERROR,
        "An axis of a drive is in Fault: its motor has no torque",
        cause="what its error code says (0x603F, EMCY); the frames before show what it was doing",
        remedy="read 0x603F and `emcy NODE`, mend the cause, then command Fault reset: a rising edge of bit 7",
        clause="CiA 402-2, 8.2, 8.4.2 (transitions 13 to 15)",
    )
    DRIVE_NOT_ENABLED = RuleRow(
        Severity.ERROR,
        "An axis is told to enable operation, and does not within a second",
        cause="a command is left out, a bit of the controlword is missing, or the power stage has no voltage",
        remedy="command Shutdown (0x0006), Switch on (0x0007), Enable operation (0x000F), each after the state before",
        clause="CiA 402-2, 8.2, 8.4.1 (transitions 2 to 4)",
    )
    DRIVE_DISABLED = RuleRow(
        Severity.ERROR,
        "An axis leaves Operation enabled though nobody commands it",
        cause="its power stage lost its voltage, its enable input opened, or a second master commands it",
        remedy="look at the supply of the power stage, the enable input (STO), and who sends controlwords",
        clause="CiA 402-2, 8.2 (transitions 8, 9)",
    )
    DRIVE_QUICK_STOP = RuleRow(
        Severity.WARNING,
        "An axis makes a quick stop that no controlword commands",
        cause="a limit switch, an input for it, or a lost heartbeat (0x6007)",
        remedy="read 0x60FD (inputs) and 0x6007, look at the limit switches",
        clause="CiA 402-2, 8.2 (transition 11), 8.4.5",
    )
    DRIVE_FOLLOWING = RuleRow(
        Severity.ERROR,
        "An axis does not follow its position demand: following error",
        cause="it is blocked or too weak, or the demand is faster than it can be",
        remedy="look at the mechanics and the load, then compare 0x60F4 with the window 0x6065 and 0x6066",
        clause="CiA 402-2, 11 (position control)",
    )
    DRIVE_HOMING = RuleRow(
        Severity.ERROR,
        "Homing of an axis has failed",
        cause="its home or limit switch was not found, or does not fit the method (0x6098)",
        remedy="look at the switches in 0x60FD while the axis is moved by hand; compare 0x6098",
        clause="CiA 402-2, 10 (homing)",
    )
    DRIVE_HELD = RuleRow(
        Severity.WARNING,
        "An axis was given a position, and is halted by its controlword",
        cause="a master has set halt (bit 8), and not taken it back",
        remedy="clear bit 8 of the controlword: the axis goes on to its target",
        clause="CiA 402-2, 8.4.1 (controlword bit 8)",
    )
    DRIVE_TARGET = RuleRow(
        Severity.WARNING,
        "An axis was given a position, and stands without reaching it",
        cause="it is blocked, at a limit, or its window (0x6067, 0x6068) is too narrow",
        remedy="read 0x6064, 0x6067 and 0x60FD; look at the mechanics",
        clause="CiA 402-2, 11 (position window), statusword bit 10",
    )
    DRIVE_MODE = RuleRow(
        Severity.WARNING,
        "An axis shows another mode of operation than it was given",
        cause="the drive does not have the mode (0x6502), or takes it only in another state",
        remedy="read 0x6502; change 0x6060 while the axis is in Switched on",
        clause="CiA 402-2, 9 (modes of operation)",
    )
    DRIVE_WARNING = RuleRow(
        Severity.WARNING,
        "An axis has a warning that lasts",
        cause="something is near its limit, such as temperature, load (I2t), or voltage",
        remedy="read 0x603F and `emcy NODE`; the manual of the drive lists its warnings",
        clause="CiA 402-2, 8.4.2 (statusword bit 7)",
    )
    DRIVE_LIMIT = RuleRow(
        Severity.INFO,
        "An internal limit of an axis stays active",
        cause="a target beyond what the drive allows: position (0x607D), velocity, torque or a limit switch",
        remedy="compare the target with 0x607D, 0x607F and 0x6072",
        clause="CiA 402-2, 8.4.2 (statusword bit 11)",
    )
    DRIVE_HALTED = RuleRow(
        Severity.INFO,
        "An axis is enabled, and halted by its controlword",
        cause="a master has set halt (bit 8), and not taken it back",
        remedy="clear bit 8 of the controlword when the axis is to move",
        clause="CiA 402-2, 8.4.1 (controlword bit 8)",
    )
    DRIVE_STOPPED = RuleRow(
        Severity.INFO,
        "An axis makes a quick stop, as its controlword commands",
        cause="a master has cleared bit 2 of the controlword",
        remedy="nothing, if it was meant",
        clause="CiA 402-2, 8.2 (transition 11)",
    )
    DRIVE_FAULT_RESET = RuleRow(
        Severity.INFO,
        "An axis was in Fault when it was first seen, and is not any more",
        cause="what its error code says (0x603F, EMCY)",
        remedy="nothing, if it does not come again",
        clause="CiA 402-2, 8.2 (transition 15)",
    )

    # I/O modules
    INPUT_FLUTTERS = RuleRow(
        Severity.WARNING,
        "A digital input changes more than 20 times in a second",
        cause="a contact that bounces or is loose, or a signal that is too fast for this input",
        remedy="look at the contact and its wiring, or set a filter time (0x6003)",
        clause="CiA 401-1, 6.3 (filter constant)",
    )
    INPUT_AT_END = RuleRow(
        Severity.INFO,
        "An analogue input stays at the end of its range",
        cause="a broken wire, a sensor without supply, or a signal beyond the range",
        remedy="measure the signal at the terminal; nothing, if the channel is not used",
        clause="CiA 401-1 (analogue inputs, 0x6401)",
    )
    INPUTS_OFF = RuleRow(
        Severity.INFO,
        "Inputs of a module cause no PDO, as that is switched off",
        cause="0x6423 is 0 after each start, until a master writes it; 0x6005 of digital inputs was cleared",
        remedy="write 1 to 0x6423 or 0x6005, or give the PDO an event timer",
        clause="CiA 401-1 (global interrupt enable)",
    )

    # SYNC and TIME
    SYNC_TWO = RuleRow(
        Severity.ERROR,
        "Two producers send SYNC",
        cause="two devices have bit 30 of 0x1005 set, or a tool sends it beside the master",
        remedy="leave one: clear bit 30 of 0x1005 in the other",
        clause="CiA 301, 7.2.5.1",
    )
    SYNC_COUNTER = RuleRow(
        Severity.ERROR,
        "The counter in SYNC leaves out a number",
        cause="a SYNC was lost, or the producer started anew",
        remedy="look for errors on the wire, and at the producer",
        clause="CiA 301, 7.2.5.3, 7.5.2.22",
    )
    SYNC_JITTER = RuleRow(
        Severity.WARNING,
        "SYNC comes more than a quarter of its period early or late",
        cause="its producer is busy, or runs on a computer without real time",
        remedy="let a device produce SYNC, or the driver send it cyclically",
        clause="CiA 301, 7.2.5.3",
    )
    SYNC_STOPS = RuleRow(
        Severity.WARNING,
        "SYNC came with a period, and stays away while nodes are OPERATIONAL",
        cause="its producer was ended, hangs, or has lost the bus",
        remedy="look at its producer; what came last is in the log at that time",
        clause="CiA 301, 7.2.5.3",
    )
    TIME_JUMPS = RuleRow(
        Severity.WARNING,
        "TIME does not go on as fast as the clock of the log",
        cause="two producers, or the clock of the producer was set",
        remedy="leave one producer (bit 30 of 0x1012)",
        clause="CiA 301, 7.2.6",
    )

    TIME_STOPS = RuleRow(
        Severity.WARNING,
        "TIME came with a period, and stays away while nodes are OPERATIONAL",
        cause="its producer was ended, hangs, or has lost the bus",
        remedy="look at its producer; what came last is in the log at that time",
        clause="CiA 301, 7.2.6",
    )

    # What says little: most often something above explains it
    PDO_STOPS = RuleRow(
        Severity.INFO,
        "A PDO came with a period, and stays away while its node is OPERATIONAL",
        cause="its sender has nothing to say any more, or has ended",
        remedy="nothing, if its sender is done; an event timer of the receiver (0x1400 and up) notices it",
        clause="CiA 301, 7.5.2.35, 7.5.2.37",
    )
    PDO_WITHOUT_FILE = RuleRow(
        Severity.INFO,
        "A node without a file has PDOs, which nobody can decode",
        cause="the other nodes have files, and this one has none",
        remedy="name its file by --eds; `devices` lists those that are known",
        clause="CiA 301, 7.3.3",
    )
    # EMCY
    EMCY_RAISED = RuleRow(
        Severity.ERROR,
        "A node reports an error and does not take it back",
        cause="as the error's words say; the register says of which kind",
        remedy="`emcy NODE` lists its errors; the device's manual has the codes from 0xFF00 on",
        clause="CiA 301, 7.2.7",
    )
    EMCY_STORM = RuleRow(
        Severity.WARNING,
        "A node sends more than 10 emergencies in a second",
        cause="an error comes and goes, or has no inhibit time",
        remedy="set 0x1015 of the node; then look for what comes and goes",
        clause="CiA 301, 7.5.2.18",
    )
    EMCY_REGISTER = RuleRow(
        Severity.WARNING,
        "An emergency has an error register without the generic error",
        cause="the device does not keep 0x1001 as it must",
        remedy="tell its maker; do not trust its 0x1001",
        clause="CiA 301, 7.5.2.2",
    )
    EMCY_CLEARED = RuleRow(
        Severity.INFO,
        "A node reports an error and takes it back",
        cause="as the error's words say",
        remedy="nothing, if it does not come again",
        clause="CiA 301, 7.2.7",
    )

    @property
    def explained(self) -> Collection[str]:
        return EXPLAINED.get(self.name, ())

    @property
    def stage(self) -> int:
        if self.name in OF_FILES:
            return 3
        return 2 if self.name.startswith("EMCY") else 0


OF_FILES = frozenset(("CAN_STARVE", "PDO_UNHEARD", "PDO_WITHOUT_FILE"))
"""Rules that judge files, not events on the bus."""


EXPLAINED: Mapping[str, Collection[str]] = {
    "NO_CANOPEN": {
        *("frame-length", "never-heard", "two-nodes", "two-clients", "sdo-unanswered", "sdo-broken", "sdo-toggle"),
        *("sdo-unasked", "sdo-abort", "sdo-probed", "state-untold", "heartbeat-lost", "heartbeat-changed"),
    },
    "OTHER_DEVICE": {
        *("other-device", "pdo-length", "pdo-timer", "pdo-inhibit", "pdo-not-sent", "pdo-no-sync", "pdo-off"),
        *("pdo-mapped-otherwise", "pdo-mapping-unknown", "out-of-range", "heartbeat-changed", "sdo-probed"),
    },
    "CONSUMER_SHORT": {"state-untold", "not-started"},
    "LOAD_FULL": {
        *(
            "load-high",
            "load-burst",
            "two-nodes",
            "heartbeat-lost",
            "heartbeat-late",
            "heartbeat-changed",
            "sdo-unanswered",
        ),
        *("sdo-broken", "sdo-unasked", "sync-jitter", "sync-stops", "pdo-timer", "pdo-stops", "boots-again"),
        *("answer-missing", "answer-late", "emcy-raised", "emcy-cleared", "not-followed", "state-untold"),
    },
    "BUS_OFF": {"error-frame"},
    "TWO_NODES": {
        *("two-nodes", "heartbeat-changed", "heartbeat-late", "state-untold", "not-followed", "boots-again"),
        *("boots-operational", "sdo-unasked", "sdo-toggle", "sdo-broken", "pdo-state", "pdo-inhibit", "guard-toggle"),
    },
    "HEARTBEAT_LOST": {
        *("heartbeat-late", "sdo-unanswered", "sdo-broken", "pdo-timer", "pdo-stops", "pdo-not-sent", "pdo-deadline"),
        *("answer-missing", "not-followed", "emcy-raised", "emcy-cleared", "emcy-register", "boots-again"),
        *("state-untold", "not-started"),
    },
    "TWO_CLIENTS": {"two-clients", "sdo-broken", "sdo-toggle", "sdo-unasked", "sdo-abort"},
    "SYNC_TWO": {"sync-two", "sync-jitter", "sync-counter"},
    "PDO_DEADLINE": {"drive-fault", "drive-quick-stop", "drive-disabled", "emcy-raised", "emcy-cleared", "pdo-stops"},
    "DRIVE_FAULT": {
        *("emcy-raised", "emcy-cleared", "drive-disabled", "drive-not-enabled", "drive-warning", "drive-target"),
        *("drive-following", "drive-homing", "pdo-stops"),
    },
    "DRIVE_DISABLED": {"drive-target", "pdo-stops"},
    "DRIVE_QUICK_STOP": {"drive-target", "pdo-stops"},
    "DRIVE_STOPPED": {"drive-target", "pdo-stops"},
    "DRIVE_HELD": {"drive-target", "pdo-stops"},
    "DRIVE_FOLLOWING": {"drive-target", "pdo-stops"},
    "SYNC_STOPS": {"pdo-stops", "pdo-timer", "pdo-deadline"},
    "GUARD_UNANSWERED": {"guard-toggle"},
}
"""Rules whose incidents follow from one of the named rule, and are shown below it."""
