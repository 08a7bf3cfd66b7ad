"""CANopen networks for programs: `Network` blocks, `AsyncNetwork` is for event loops.

Theory of operation. Both are faces of one master (`master`, `masters`), and what they do is written once, as
procedures. A `Network` on a bus reads on a thread of its own, so that states, emergency messages and PDOs are there
when a program looks. In simulated time (`simulated`) there is no thread, and time passes while the program waits.
"""

from __future__ import annotations

import logging
import os
from abc import abstractmethod
from collections import deque
from collections.abc import Callable, Iterable, Iterator, Sequence
from contextlib import contextmanager
from datetime import UTC, datetime
from functools import partial
from itertools import islice
from pathlib import Path
from typing import TYPE_CHECKING, Any, Generic, Never, NoReturn, Self, TypeAlias, TypeVar

import can
import canopen

from eurobot_od.bus.live import is_named, open_bus
from eurobot_od.bus.simulated.network import Simulation
from eurobot_od.bus.simulated.simulated_bus import SimulatedBus
from eurobot_od.canopen_names import NamedAsInCanopen
from eurobot_od.client import lss
from eurobot_od.client.description import LISTEN, Found, check_free, read_numbers, scan, uploaded
from eurobot_od.client.drive402 import STATES
from eurobot_od.client.lss import LssSteps, Result
from eurobot_od.client.master import (
    ANSWER_WAIT,
    CLOSED,
    NMT_LOG,
    Master,
    PeriodicTask,
    blocking,
    function_of,
    seconds,
    syncs,
    times,
)
from eurobot_od.client.masters import Feed, LoopMaster, OwnFeed, ThreadedMaster, feed_of
from eurobot_od.client.remote_device import (
    DISCONNECTED,
    UNCONNECTED,
    AsyncRemoteDevice,
    DeviceAtNode,
    DeviceFile,
    NoMaster,
    RemoteDevice,
)
from eurobot_od.client.streams import EndlessIterator, Keyed
from eurobot_od.client.watch import LOST_AFTER, NodeEvent, NodeWatch
from eurobot_od.controller import Report
from eurobot_od.device.nmt import COMMAND_NAMES, NmtCommand, canopen_state, command_to
from eurobot_od.device.simulated import SimulatedDevice
from eurobot_od.device.station import Station
from eurobot_od.errors import DriveError, LocalError, RemoteError, StateError, UnknownName, look_up
from eurobot_od.frame import Frame
from eurobot_od.library.library import VARIABLE, Library, LibraryDevices, folders
from eurobot_od.od import DEFAULT, cia402
from eurobot_od.od.cia402 import MODE_WORDS, Mode, State
from eurobot_od.od.dictionary import Dictionary
from eurobot_od.od.identity import Identity
from eurobot_od.od.network import NodeFile, load, read_network
from eurobot_od.od.standard import BIT_RATES, LSS_IDENTITY, Lss, LssState
from eurobot_od.od.values import ALL_NODES, BUS_BIT_RATES, NMT_COB_ID, NODE_IDS, SYNC_COB_ID, check_node_id

BusName: TypeAlias = "str | can.BusABC | canopen.Network | None"
"""Name of a python-can interface, an open bus, or a connected canopen network whose bus is shared."""

Channel: TypeAlias = "str | int | None"
"""A channel by python-can's name or number."""

Callback: TypeAlias = Callable[[int, bytes, float], object]
"""Function called with the COB-ID, data and time (in s) of a frame."""

SimulatedFile: TypeAlias = "SimulatedDevice | Dictionary | str | Path"
"""A simulated device, or an EDS or DCF from which it runs."""

AnyDevice = TypeVar("AnyDevice", bound=DeviceAtNode)

LSS_WAIT = lss.ANSWER_WAIT

NO_BUS = 'which bus? Name interface and channel, such as "socketcan", "can0", or configure python-can'


def _feed(
    bus: BusName,
    channel: Channel,
    bitrate: int | None,
    *,
    interface: BusName = None,
    bustype: BusName = None,
    **options: Any,
) -> Feed:
    """Open a bus by its interface, which has three names, or share one that is open; raises BusError, LocalError."""
    if bitrate is not None and not (isinstance(bitrate, int) and bitrate in BUS_BIT_RATES):
        raise LocalError(f"bitrate = {bitrate!r} is not in 1000..1000000 bit/s, such as 500000")
    bus = next((each for each in (bus, interface, bustype) if each is not None), None)
    if bus is None and not is_named(bus):
        raise LocalError(NO_BUS)
    if bus is None or isinstance(bus, str):
        return OwnFeed(partial(open_bus, bus, channel, bitrate, **options))
    return feed_of(bus)


class NodeWatcher(EndlessIterator[NodeEvent]):
    """An endless iterator over events of nodes."""

    def __init__(self, master: Master, node_ids: Sequence[int], within: float, guard: float | None) -> None:
        self._master = master
        self._events = deque[NodeEvent]()
        guarded = dict.fromkeys(node_ids, guard) if guard else {}
        periods = dict.fromkeys(node_ids, within / LOST_AFTER)  # until two heartbeats have shown its period
        self._watch = NodeWatch(self._events.append, periods, node_ids, within, guarded)
        self._watch.tick(master.clock())
        self._observed = master.observed(self._watch.observer(master))
        self._observed.__enter__()

    def close(self) -> None:
        """Stop watching."""
        self._observed.__exit__(None, None, None)

    async def _next(self) -> NodeEvent:
        while not self._events:
            await self._master.pump.steps(self._watch.ask(self._master), lambda: bool(self._events))
        return self._events.popleft()


class NetworkOfDevices(Keyed, Generic[AnyDevice]):
    """Base class of both networks; nothing in here waits.

    `library` describes nodes that are added without a file; it is that of the environment, if it names one.
    """

    master: Master = UNCONNECTED
    _kind: type[AnyDevice]

    def __init__(self) -> None:
        self.library = Library(folders()) if os.environ.get(VARIABLE) else None
        self._devices: dict[int, AnyDevice] = {}
        self._sync = NetworkSync(self)

    @classmethod
    @abstractmethod
    def _on(cls, open_feed: Callable[[], Feed], answer_wait: float) -> Self:
        """Create a network on a feed, which it opens."""

    @classmethod
    def open(
        cls,
        bus: BusName = None,
        channel: Channel = None,
        bitrate: int | None = None,
        *,
        answer_wait: float = ANSWER_WAIT,
        interface: BusName = None,
        bustype: BusName = None,
    ) -> Self:
        """Open a bus by python-can's names for interface and channel; `bitrate` is in bit/s.

        `interface` and `bustype` are python-can's new and old name for `bus`. Whatever is left out comes from
        python-can's configuration. A bus that is already open, or a connected `canopen.Network`, is shared and stays
        open at the end. A node has `answer_wait` seconds for each answer. Raises LocalError, BusError, an AsyncNetwork
        at its `async with`, which opens the bus.
        """
        return cls._on(partial(_feed, bus, channel, bitrate, interface=interface, bustype=bustype), answer_wait)

    @classmethod
    def load(cls, file: str | Path = DEFAULT, bus: BusName = None, channel: Channel = None, **options: Any) -> Self:
        """Open a bus with all devices of a network file (`network.yaml`, `nodelist.cpj`) or of a folder of EDS files.

        The bit rate is the file's; `options` are those of `open`. Raises FileError, BusError, LocalError.
        """
        described = read_network(file)
        network = cls.open(bus, channel, described.bit_rate and described.bit_rate * 1000, **options)
        if described.library:
            network.library = Library(folders(written=described.library))
        for each in load(node for node in described.nodes if node.file):
            network.add(each.node_id, each)
        for node in described.nodes:
            if node.node_id and not node.file:
                network.add(node.node_id, name=node.name)
        return network

    def _begin(self, master: Master) -> None:
        self.master = master
        master.observers = (*master.observers, self._receive)
        for device in self:
            device.join(master)

    @property
    def is_open(self) -> bool:
        """Whether the network has a bus."""
        return not isinstance(self.master, NoMaster)

    def _end(self) -> None:
        if self.is_open:
            self.master.close()
            for device in self:
                device.leave(self.master)
            self.master = DISCONNECTED

    def _receive(self, cob_id: int, data: bytes, now: float) -> None:
        for device in self._devices.values():
            device.receive(cob_id, data, now)

    def add(self, node_id: int, file: DeviceFile = None, name: str = "") -> AnyDevice:
        """Add a device by its node-ID (1..127) and its EDS or DCF, and return it; nothing is sent.

        In place of a file, a `Dictionary` or canopen's ObjectDictionary will do. Without any of them, objects are
        numbers and bytes. `name` is the file's by default. Raises DictionaryError, LocalError.
        """
        return self._added(self._kind(node_id, file, name))

    def _added(self, device: AnyDevice) -> AnyDevice:
        if self.is_open:
            device.join(self.master)
        # Replaced as a whole, as the reader may be iterating over it.
        self._devices = {**self._devices, device.node_id: device}
        return device

    def __getitem__(self, node: int | str | DeviceAtNode) -> AnyDevice:
        """Return a device that was added, by its node-ID or name; raises UnknownName."""
        for device in self._devices.values():
            if node in (device.node_id, device.name, device):
                return device
        raise UnknownName("node", node, [each.name for each in self._devices.values()])

    def __iter__(self) -> Iterator[AnyDevice]:
        return iter([*self._devices.values()])

    def __len__(self) -> int:
        return len(self._devices)

    def __repr__(self) -> str:
        nodes = ", ".join(f"{each.node_id} {each.name}" for each in self)
        return f"<{type(self).__name__} of {nodes or 'no nodes yet'}>"

    def _ipython_key_completions_(self) -> list[str]:
        """Return the names of the nodes, for completion of `network["` in IPython."""
        return [each.name for each in self]

    @property
    def dictionaries(self) -> tuple[Dictionary, ...]:
        """Dictionaries of the devices that have one."""
        return tuple(each.dictionary for each in self if each.dictionary is not None)

    def send(self, cob_id: int, data: bytes = b"") -> None:
        """Send any frame: an 11-bit identifier and up to 8 bytes. Raises BusError."""
        self.master.send(*Frame.checked(cob_id, data))

    @property
    def sync(self) -> NetworkSync:
        """SYNC: `network.sync(period=0.01)` sends one every 10 ms."""
        return self._sync

    def watch(self, *node_ids: int, within: float = LOST_AFTER, guard: float | None = None) -> NodeWatcher:
        """Return an endless iterator over events of nodes: found, booted, lost, back.

        The named nodes are lost if they are not heard `within` that many seconds. Every node that is heard is watched
        by the period of its heartbeats, and lost after two periods of silence. `guard` is the period in seconds at
        which nodes without heartbeats are asked by remote frames.
        """
        return NodeWatcher(self.master, [*map(check_node_id, node_ids)], seconds(within), guard)

    async def _scan(self, node_ids: Iterable[int] = NODE_IDS, listen: float = LISTEN) -> list[Found]:
        """Return the nodes that answer SDO or send a heartbeat within `listen` seconds, by node-ID."""
        return await scan.steps(self.master, map(check_node_id, node_ids), listen=seconds(listen))


class NetworkSync(NamedAsInCanopen):
    """The SYNC of a network: call it, or `start` and `stop` it as users of canopen do."""

    def __init__(self, network: NetworkOfDevices[Any]) -> None:
        self._network = network
        self._task: PeriodicTask | None = None

    def __call__(self, period: float, counter: int | None = None, cob_id: int = SYNC_COB_ID) -> PeriodicTask:
        """Send a SYNC every `period` seconds from now on, until `stop()` of what is returned, or the network's end.

        With a `counter` (2..240) they are numbered from 1 to it, again and again (0x1019). The driver sends them, or
        the kernel with SocketCAN, so that a busy program does not delay them. Raises LocalError, BusError.
        """
        return PeriodicTask(self._network.master, [*islice(syncs(counter, cob_id), counter or 1)], period)

    def start(self, period: float) -> None:
        """Send a SYNC every `period` seconds until `stop`, in place of what was started before."""
        self.stop()
        self._task = self(period)

    def stop(self) -> None:
        """Stop the SYNC of `start`."""
        if self._task is not None:
            self._task.stop()

    def transmit(self, count: int | None = None) -> None:
        """Send one SYNC, with a counter if it is given; raises BusError."""
        self._network.send(SYNC_COB_ID, b"" if count is None else bytes([count]))


class NetworkTime(NamedAsInCanopen):
    """The TIME message of a network, as canopen has it."""

    def __init__(self, network: NetworkOfDevices[Any]) -> None:
        self._network = network

    def transmit(self, timestamp: float | None = None) -> None:
        """Send one TIME, of now or of a Unix time in seconds; raises BusError."""
        at = datetime.now(UTC) if timestamp is None else datetime.fromtimestamp(timestamp, UTC)
        self._network.send(*next(times(lambda: at.replace(tzinfo=None))))


class NetworkNmt(NamedAsInCanopen):
    """NMT commands to all nodes of a network at once; they are not confirmed. Each raises BusError."""

    def __init__(self, network: NetworkOfDevices[Any]) -> None:
        self._network = network

    def command(self, command: NmtCommand) -> None:
        """Send a command to all nodes; it invalidates earlier heartbeats."""
        master = self._network.master
        with master.guard:
            master.states.clear()
            master.booted.clear()
        NMT_LOG.info("all nodes: command %s", COMMAND_NAMES[command])
        master.send(NMT_COB_ID, bytes([command, ALL_NODES]))

    def _send_to(self, state: str) -> None:
        self.command(command_to(state))

    def _common_state(self) -> str:
        states = {*self._network.master.states.values()}
        return canopen_state(states.pop() if len(states) == 1 else None)

    state = property(
        _common_state,
        _send_to,
        doc="The state of all nodes that are heard, `UNKNOWN` if they differ; set it to send the command to all nodes.",
    )

    def send_command(self, code: int) -> None:
        """Send a command by its number to all nodes."""
        self.command(NmtCommand(code))

    def start(self) -> None:
        """Make all nodes OPERATIONAL."""
        self.command(NmtCommand.START)

    def stop(self) -> None:
        """Make all nodes STOPPED."""
        self.command(NmtCommand.STOP)

    def enter_pre_operational(self) -> None:
        """Make all nodes PRE-OPERATIONAL."""
        self.command(NmtCommand.ENTER_PRE_OPERATIONAL)

    def reset(self) -> None:
        """Reset all nodes, without waiting for their boot-up messages."""
        self.command(NmtCommand.RESET_NODE)


class LssOfNetwork:
    """Base class of the layer setting services of both networks."""

    def __init__(self, network: NetworkOfDevices[Any]) -> None:
        self._network = network

    async def _find(self, wait: float = LSS_WAIT) -> list[Identity]:
        """Return the devices without a node-ID, after about 130 requests for each. Raises BusError."""
        return await self._perform(lss.find_all(), wait)

    async def _assign(
        self,
        node_id: int,
        identity: Identity | None = None,
        *,
        bit_rate: int | None = None,
        store: bool = True,
        wait: float = LSS_WAIT,
    ) -> Identity | None:
        """Assign a node-ID, and a bit rate in kbit/s, to the device with an identity (None: the first without one).

        Returns the identity of that device. Raises RemoteError if there is none, if it refuses, or if another device
        has the node-ID; NoAnswer, LocalError, BusError.
        """
        await check_free.steps(self._network.master, node_id, identity)
        return await self._perform(lss.assigned(node_id, identity, bit_rate, store), wait)

    async def _perform(self, steps: LssSteps[Result], wait: float) -> Result:
        try:
            return await lss.perform.steps(self._network.master, steps, wait)
        finally:
            # A device left in configuration state would obey commands for others.
            await lss.perform.steps(self._network.master, lss.switch(LssState.WAITING))


class NetworkLss(LssOfNetwork, NamedAsInCanopen):
    """Devices without a node-ID, by the layer setting services (CiA 305); every call takes 0.1 s for each answer."""

    find, assign = blocking(LssOfNetwork._find), blocking(LssOfNetwork._assign)

    # As canopen calls them: one service after the other, and devices stay in the state that they were switched to.

    WAITING_STATE, CONFIGURATION_STATE = LssState.WAITING, LssState.CONFIGURATION
    NORMAL_MODE, CONFIGURATION_MODE = LssState.WAITING, LssState.CONFIGURATION

    RESPONSE_TIMEOUT = LSS_WAIT
    """Timeout of each answer of a device, in s."""

    def _one(self, steps: LssSteps[Result]) -> Result:
        return lss.perform(self._network.master, steps, self.RESPONSE_TIMEOUT)

    def send_switch_state_global(self, mode: int) -> None:
        """Switch all devices to `WAITING_STATE` or `CONFIGURATION_STATE`; they do not answer."""
        self._one(lss.switch(LssState(mode)))

    send_switch_mode_global = send_switch_state_global

    def send_switch_state_selective(self, *identity: int) -> bool:
        """Switch the device with an identity (four numbers) to configuration state; return whether it exists."""
        return self._one(lss.select(Identity(*identity)))

    def fast_scan(self) -> tuple[bool, Identity | None]:
        """Find a device without a node-ID; return whether there is one, and its identity."""
        found = self._one(lss.fastscan())
        return found is not None, found

    def inquire_node_id(self) -> int:
        """Return the node-ID of the device that is being configured, 255 if it has none; raises NoAnswer."""
        return self._one(lss.inquire_node_id())

    def configure_node_id(self, new_node_id: int) -> None:
        """Set the node-ID of the device being configured; raises RemoteError if it refuses, NoAnswer."""
        self._one(lss.configure_node_id(new_node_id))

    def inquire_lss_address(self, req_cs: int) -> int:
        """Return a number of its identity: 0x5A vendor-ID, 0x5B product code, 0x5C revision, 0x5D serial number.

        Raises LocalError for another command, NoAnswer.
        """
        if req_cs - Lss.INQUIRE not in range(len(LSS_IDENTITY)):
            raise LocalError(f"0x{req_cs:02X} asks for no part of an identity; 0x5A to 0x5D do")
        return self._one(lss.inquire_identity())[req_cs - Lss.INQUIRE]

    def configure_bit_timing(self, new_bit_timing: int) -> None:
        """Set its bit rate by the number in the table of CiA 305 (2 is 500 kbit/s); raises RemoteError, NoAnswer."""
        rates = {str(number): kbit for kbit, number in BIT_RATES.items()}
        self._one(lss.configure_bit_rate(look_up("bit timing", str(new_bit_timing), rates)))

    def activate_bit_timing(self, switch_delay_ms: int) -> None:
        """Order the devices in configuration to change their bit rate after a delay in ms; they do not answer."""
        self._one(lss.activate_bit_rate(switch_delay_ms / 1000))

    def store_configuration(self) -> None:
        """Make the device store its node-ID and bit rate; raises RemoteError if it refuses, NoAnswer."""
        self._one(lss.store())


class NodeScanner(NamedAsInCanopen):
    """The nodes that were heard or that `search` has found; see `Network.scan`, which also says what they are."""

    def __init__(self, network: Network) -> None:
        self._network = network
        self._found: set[int] = set()

    @property
    def nodes(self) -> list[int]:
        """Their node-IDs."""
        return sorted({*self._found, *self._network.master.states})

    def search(self, limit: int = NODE_IDS[-1]) -> None:
        """Search the nodes 1 to `limit`, which takes about two seconds; raises BusError."""
        self._found = {each.node_id for each in self._network.scan(range(1, limit + 1))}

    def reset(self) -> None:
        """Forget all found nodes; those with heartbeats are found again."""
        self._found = set()
        self._network.master.states.clear()


class AsyncNetworkLss(LssOfNetwork):
    """Devices without a node-ID: NetworkLss, awaited."""

    find, assign = LssOfNetwork._find, LssOfNetwork._assign


class Network(NetworkOfDevices[RemoteDevice], NamedAsInCanopen):
    """A CANopen network for programs that block: a bus with devices by name; use it as a context manager.

        with Network.open("socketcan", "can0") as network:
            drive = network.add(5, "epos4.eds")
            drive.configure("drive.dcf")
            drive.nmt.start()
            network.sync(period=0.01)
            for reading in drive.pdo["TPDO1"]:
                print(reading.time, reading["Velocity actual value"])

    `network.scan()` finds nodes, `network.watch()` notices lost ones, `network.lss` assigns node-IDs, `network.nmt`
    commands all nodes. Your own functions (`drive.emcy.on(print)`) run on one thread beside yours, and may talk to
    nodes. A bus that is lost is opened again; a call that is waiting then raises BusError.
    """

    _kind = RemoteDevice
    _parts = {".nmt": NetworkNmt, ".lss": NetworkLss, "[node]": RemoteDevice}  # noqa: RUF012

    def __init__(self, bus: can.BusABC | Master | None = None, *others: Never) -> None:
        if others or isinstance(bus, str):
            raise TypeError("Network(bus) takes a bus that is open; Network.open(interface, channel) opens one")
        super().__init__()
        self.nmt, self.lss, self.scanner = NetworkNmt(self), NetworkLss(self), NodeScanner(self)
        self.time = NetworkTime(self)
        self._subscribers: dict[int, list[Callback]] = {}
        if isinstance(bus, Master):
            self._begin(bus)
        elif bus is not None:
            self.bus = bus

    @classmethod
    def _on(cls, open_feed: Callable[[], Feed], answer_wait: float) -> Self:
        return cls(ThreadedMaster(open_feed(), answer_wait))

    def add(self, node_id: int, file: DeviceFile = None, name: str = "") -> RemoteDevice:
        """Add a device by its node-ID and its EDS or DCF, and return it.

        Without a file, and with a `library`, the node is asked what it is (0x1018, 0x1000), and the file that fits is
        taken; without one that fits, objects are numbers and bytes.

        Args:
            node_id: 1 to 127
            file: an EDS or DCF, a `Dictionary`, or canopen's ObjectDictionary
            name: name of the device; default: the file's

        Raises:
            DictionaryError: the file cannot be used
            LocalError: node-ID or name is taken, or out of range
            RemoteError, BusError: the node that is asked does not answer
        """
        return self.add_node(RemoteDevice(node_id, file or self._in_library(node_id, name), name))

    def _in_library(self, node_id: int, name: str) -> Dictionary | None:
        if self.library is None or not self.is_open:
            return None
        describe = LibraryDevices(self.library, NMT_LOG.warning, nodes={node_id: NodeFile("", node_id, name)})
        return describe(node_id, read_numbers(self.master.node(node_id)))

    def close(self) -> None:
        """Stop periodic frames and threads, and close the bus unless it is shared.

        A call that waits, or comes later, raises StateError, until `connect` opens a bus again.
        """
        self._end()

    def __enter__(self) -> Self:
        if self.master is DISCONNECTED:
            raise StateError(CLOSED)
        return self

    def __exit__(self, *_: object) -> None:
        self.close()

    def sleep(self, seconds: float) -> None:
        """Wait while states, emergency messages and PDOs come in; raises BusError if the bus is lost."""
        self.master.pump(seconds)

    scan = blocking(NetworkOfDevices._scan)

    # As canopen calls them

    def connect(
        self,
        channel: Channel = None,
        interface: BusName = None,
        bitrate: int | None = None,
        bustype: BusName = None,
        **options: Any,
    ) -> Self:
        """Open the bus of a network that was created without one, with the arguments of canopen.

        A network that is open is closed first, unless nothing is given: then it keeps its bus.

        Args:
            channel: the adapter or bus, such as `can0`
            interface: name of python-can's interface, such as `socketcan`
            bitrate: in bit/s
            bustype: the name that `interface` had before python-can 4.2
            options: options of the interface, such as `receive_own_messages`

        Raises:
            LocalError: neither an argument nor python-can's configuration names an interface
            BusError: the bus cannot be opened
        """
        if self.is_open and (channel, interface, bitrate, bustype) == (None,) * 4 and not options:
            return self
        self._end()
        self._begin(ThreadedMaster(_feed(interface, channel, bitrate, bustype=bustype, **options)))
        return self

    @property
    def bus(self) -> can.BusABC | None:
        """python-can's bus, None while there is none; a network without one may be given one, which stays open."""
        return self.master.bus if self.is_open else None

    @bus.setter
    def bus(self, bus: can.BusABC) -> None:
        self._end()
        self._begin(ThreadedMaster(_feed(bus, None, None)))

    disconnect = close

    def check(self) -> None:
        """Check that the bus is not lost; raises BusError."""
        if self.master.failure is not None:
            raise self.master.failure

    @property
    def nodes(self) -> dict[int, RemoteDevice]:
        """The devices that were added, by node-ID."""
        return {each.node_id: each for each in self}

    def keys(self) -> list[int]:
        """The node-IDs of the devices that were added."""
        return [*self.nodes]

    def values(self) -> list[RemoteDevice]:
        """The devices that were added."""
        return [*self]

    def items(self) -> list[tuple[int, RemoteDevice]]:
        """The devices that were added, with their node-IDs."""
        return [*self.nodes.items()]

    def get(self, node: int | str | RemoteDevice, default: Any = None) -> Any:
        """Return a device that was added, by its node-ID or name, or else the default."""
        return next((each for each in self if node in (each.node_id, each.name, each)), default)

    def __delitem__(self, node: int | str | RemoteDevice) -> None:
        """Forget a device that was added; raises UnknownName."""
        gone = self[node]
        self._devices = {node_id: each for node_id, each in self._devices.items() if each is not gone}
        gone.network = None

    def add_node(
        self, node: int | RemoteDevice, object_dictionary: DeviceFile = None, upload_eds: bool = False
    ) -> RemoteDevice:
        """Add a node that was made as `RemoteDevice(5, "drive.eds")`, or by its node-ID; see `add`.

        With `upload_eds` the file is the one that the node keeps of itself (0x1021); raises RemoteError without one.
        A node that the canopen package has made raises LocalError.
        """
        if isinstance(node, RemoteDevice):
            node.network = self
            return self._added(node)
        if not isinstance(node, int):
            ours = "import RemoteNode or BaseNode402 from eurobot_od"
            raise LocalError(f"a {type(node).__name__} of the package canopen belongs in canopen's Network; {ours}")
        if upload_eds:
            object_dictionary = uploaded(self.master.node(node))
            if object_dictionary is None:
                raise RemoteError(f"node {node} keeps no EDS of itself in plain text (0x1021)")
        return self.add(node, object_dictionary)

    def send_message(self, can_id: int, data: bytes, remote: bool = False) -> None:
        """Send a frame, or a remote frame if `remote`."""
        self.master.request(can_id) if remote else self.send(can_id, data)

    def send_periodic(self, can_id: int, data: bytes, period: float, remote: bool = False) -> PeriodicTask:
        """Send a frame every `period` seconds, until `stop()` of what is returned; raises LocalError, BusError."""
        return PeriodicTask(self.master, [Frame.checked(can_id, data or b"")], period, remote)

    def subscribe(self, can_id: int, callback: Callback) -> None:
        """Call a function with the COB-ID, data and time of each frame of an identifier."""
        self._subscribers.setdefault(can_id, []).append(function_of(callback))

    def unsubscribe(self, can_id: int, callback: Callback | None = None) -> None:
        """Stop calling a function, or all functions of an identifier."""
        kept = [each for each in self._subscribers.pop(can_id, []) if callback not in (None, each)]
        self._subscribers |= {can_id: kept} if kept else {}

    def _receive(self, cob_id: int, data: bytes, now: float) -> None:
        super()._receive(cob_id, data, now)
        for callback in self._subscribers.get(cob_id, ()):
            self.master.call(partial(callback, cob_id, data, now))


class AsyncNetwork(NetworkOfDevices[AsyncRemoteDevice]):
    """A CANopen network in an event loop: what Network has, awaited, without a thread for each node.

        async with AsyncNetwork.open("socketcan", "can0") as network:
            drives = [network.add(node_id, "epos4.eds") for node_id in range(1, 21)]
            await asyncio.gather(*(drive.configure(f"{drive.node_id}.dcf") for drive in drives))
            async for reading in drives[0].pdo["TPDO1"]:
                print(reading.time, reading["Velocity actual value"])

    Your own functions run in the loop.
    """

    _kind = AsyncRemoteDevice

    def __init__(self, open_feed: Callable[[], Feed], answer_wait: float = ANSWER_WAIT) -> None:
        super().__init__()
        self._open_feed, self._answer_wait = open_feed, answer_wait
        self.nmt, self.lss = NetworkNmt(self), AsyncNetworkLss(self)

    @classmethod
    def _on(cls, open_feed: Callable[[], Feed], answer_wait: float) -> Self:
        return cls(open_feed, answer_wait)

    if not TYPE_CHECKING:  # a type checker refuses a plain `with` anyway

        def __enter__(self, *_: object) -> NoReturn:
            ours = type(self).__name__
            raise TypeError(f"write `async with`: {ours} is for an event loop, and Network for programs that block")

        __exit__ = __enter__

    async def __aenter__(self) -> Self:
        self._begin(LoopMaster(self._open_feed(), self._answer_wait))
        return self

    async def __aexit__(self, *_: object) -> None:
        self.close()

    def close(self) -> None:
        """Stop periodic frames and the reading, and close the bus unless it is shared."""
        self._end()

    scan = NetworkOfDevices._scan


class SimulatedNetwork(Network):
    """A network and its devices in simulated time, which passes while the program waits, and costs no real time.

    `simulation` is the bus, to which more devices can be attached, and which loses frames on demand. `devices` are the
    simulated ones by node-ID, whose values can be read and set; `stations` are their places on the bus.
    """

    def __init__(self, simulation: Simulation | None = None) -> None:
        self.simulation = simulation or Simulation()
        self.devices: dict[int, SimulatedDevice] = {}
        self.stations: dict[int, Station] = {}
        super().__init__(Master(SimulatedBus(self.simulation), clock=lambda: self.simulation.now))

    def simulate(self, device: SimulatedFile, node_id: int | None = None, **options: Any) -> RemoteDevice:
        """Attach a device, or one made from an EDS or DCF, and add it; it has booted on return.

        `options` are those of SimulatedDevice: `given` values, `waveforms`.
        """
        if isinstance(device, (str, Path)):
            device = Dictionary.load(device, node_id)
        made = SimulatedDevice(device, **options) if isinstance(device, Dictionary) else device
        dictionary = made.dictionary
        self.devices[dictionary.node_id] = made
        self.stations[dictionary.node_id] = self.simulation.attach(made, self.simulation.now, report=self._report)
        added = self.add(dictionary.node_id, dictionary)
        self.sleep(BOOT_TIME)
        return added

    def _report(self, report: Report) -> None:
        """Keep a report, and log the exception of a node, which its client only sees as silence."""
        self.simulation.reports.append(report)
        if report.error is not None:
            logging.getLogger("eurobot_od").error("%s", report, exc_info=report.error)


BOOT_TIME = 0.05
"""Time for a device to boot, in simulated s."""


@contextmanager
def simulated(*devices: SimulatedFile, node_id: int | None = None, **options: Any) -> Iterator[SimulatedNetwork]:
    """Return a network in simulated time, as a context manager, with devices that run from their EDS or DCF files.

    It is made for tests: nothing waits in real time.

        with simulated("motor.eds", node_id=5) as network:
            assert network[5]["Temperature"].value == 20.0

    Args:
        devices: EDS or DCF files, or devices that were made
        node_id: node-ID of the first file without its own; further ones get the numbers after it
        options: options of SimulatedDevice: `given` values by name, `waveforms`

    Raises:
        DictionaryError: a file cannot be used
    """
    with SimulatedNetwork() as network:
        for number, device in enumerate(devices):
            network.simulate(device, None if node_id is None else node_id + number, **options)
        yield network


# Classes under the names that users of canopen know: `import eurobot_od as canopen` is all that their programs change.
# `RemoteNode` is what `network.add` returns, `BaseNode402` is `drive402` with texts for states and modes; a drive is
# commanded and asked by SDO, whatever the PDOs map. docs/python.md says what is different.


RemoteNode = RemoteDevice

MODES = {words.upper().replace("PROFILE ", "PROFILED "): Mode(mode) for mode, words in MODE_WORDS.items()}
"""Modes of operation by their names in canopen."""

HOMING_WAIT = 30.0
"""Default timeout of `homing`, in s."""


class BaseNode402(RemoteDevice):
    """A drive on a `Network`, with the interface of canopen's class; `drive402` has more checks."""

    def setup_402_state_machine(self, read_pdos: bool = True) -> None:
        """Read the node's PDO mapping if `read_pdos`; nothing else is needed."""
        self.pdo.read(from_od=not read_pdos)

    setup_pdos = setup_402_state_machine

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
        target = look_up("state of a drive", wanted, STATES)
        if target is State.DISABLED:
            self.drive402.fault_reset()
        self.drive402.bring_to(target)

    @property
    def op_mode(self) -> str:
        """The mode of operation, such as `PROFILED POSITION`; set it to change it. Raises UnknownName, DriveError."""
        shown = self[cia402.MODE_DISPLAY].read(int)
        return next((words for words, mode in MODES.items() if mode == shown), str(shown))

    @op_mode.setter
    def op_mode(self, words: str) -> None:
        self.drive402.choose(look_up("mode of operation", words, MODES))

    def is_op_mode_supported(self, words: str) -> bool:
        """Return whether the drive reports a mode as supported (0x6502)."""
        return MODES.get(words) in cia402.supported(self[cia402.SUPPORTED_MODES].read(int))

    def is_faulted(self) -> bool:
        """Return whether the drive is in the state Fault."""
        return self.drive402.state is State.FAULT

    def reset_from_fault(self) -> None:
        """Reset the fault and enable the drive."""
        self.drive402.fault_reset()
        self.drive402.enable()

    def homing(self, timeout: float = HOMING_WAIT) -> bool:
        """Enable the drive and home it by the set method; return whether it found home."""
        try:
            self.drive402.home(within=timeout)
        except DriveError:
            return False
        return True
