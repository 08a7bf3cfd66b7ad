"""Names of the canopen package that we do not have, each with what to use instead; objects as files.

A program for canopen that asks for such a name gets an AttributeError or ImportError that ends with the remedy.
docs/canopen.md shows the table, and a test compares both packages, name by name.
"""

from __future__ import annotations

import sys
from collections.abc import Callable, Iterable, Mapping
from importlib.machinery import ModuleSpec
from io import BytesIO, TextIOWrapper
from operator import attrgetter
from types import ModuleType
from typing import IO, TYPE_CHECKING, Any, ClassVar, NoReturn
from warnings import warn

from eurobot_od.errors import LocalError

OURS = __name__.partition(".")[0]
INSTEAD = "use instead"
SHARED = "`network.master` is what the objects of a network share"
HEARD = "frames reach it by themselves: `network.subscribe(cob_id, function)` for your own use"
SIMULATED = "a `SimulatedDevice` run by `Live.node(bus, device)`, or a `LocalNode` of canopen on a bus of its own"
OWN_THREAD = "leave it out: the network reads on a thread of its own; `check()` raises what has stopped it"
WAITS = "`drive402` has the same with `within` in seconds"
OBJECT = "`node[...]`"
CLASSES = "`node[...]`; canopen's classes are those of `node.od[...]`, such as `ODRecord`"
VARIABLE = "the variable of the file has it: `.od`"
RECORDS = "the objects themselves: `node[0x1800, 1]`, `node[0x1A00, 1]`"

MISSING = {
    "eurobot_od": {
        "LocalNode": SIMULATED,
        "NodeScanner": "`network.scanner`, or `network.scan()`",
        "sync": "`network.sync`",
        "timestamp": "`network.time`",
        "utils": "`eurobot_od.od`",
        "variable": OBJECT,
    },
    "eurobot_od.emcy": {"EmcyConsumer": "`node.emcy`", "EmcyProducer": SIMULATED},
    "eurobot_od.lss": {"LssMaster": "`network.lss`"},
    "eurobot_od.network": {
        "MessageListener": "`network.subscribe(cob_id, function)`",
        "NodeScanner": "`network.scanner`, or `network.scan()`",
        "PeriodicMessageTask": "`network.send_periodic`",
    },
    "eurobot_od.nmt": {
        "NmtBase": "`node.nmt`, or `network.nmt`",
        "NmtMaster": "`node.nmt`, or `network.nmt`",
        "NmtSlave": SIMULATED,
    },
    "eurobot_od.node": {"LocalNode": SIMULATED, "base": "`RemoteNode`", "local": SIMULATED},
    "eurobot_od.pdo": {
        "PDO": "`node.pdo`",
        "PdoBase": "`node.pdo`",
        "PdoMap": "`node.tpdo[1]`",
        "PdoMaps": "`node.tpdo`, or `node.rpdo`",
        "PdoVariable": "`node.tpdo[1][0]`",
        "RPDO": "`node.rpdo`",
        "TPDO": "`node.tpdo`",
        "Variable": "`node.tpdo[1][0]`",
        "base": "`node.pdo`",
    },
    "eurobot_od.profiles.p402": {"Homing": "`homing()`, or `drive402.home()`"},
    "eurobot_od.sdo": {
        **dict.fromkeys(("Array", "Record", "SdoArray", "SdoRecord", "SdoVariable", "Variable", "base"), CLASSES),
        "SdoClient": "`node.sdo`",
        "SdoServer": SIMULATED,
        "constants": "`eurobot_od.sdo.wire`",
    },
    "Network": {
        "NOTIFIER_CYCLE": OWN_THREAD,
        "NOTIFIER_SHUTDOWN_TIMEOUT": OWN_THREAD,
        "clear": "`del network[5]` for each node",
        "create_node": SIMULATED,
        "listeners": "`network.subscribe(cob_id, function)`, or a `can.Notifier` on a bus of yours before `connect`",
        "notifier": OWN_THREAD,
        "notify": "a bus that you give: `Network.open(bus)`",
        "pop": "`del network[5]`",
        "popitem": "`del network[5]`",
        "send_lock": "leave it out: any thread may send",
        "setdefault": "`network.add_node`",
        "subscribers": "`network.subscribe` and `unsubscribe`",
        "update": "`network.add_node`",
    },
    "RemoteDevice": {
        "MAX_RETRIES": "a higher `RESPONSE_TIMEOUT`: a read that another client has disturbed is repeated anyway",
        "PAUSE_BEFORE_SEND": "leave it out: each request waits for the answer to the one before",
        "RETRY_DELAY": "a higher `RESPONSE_TIMEOUT`",
        "abort": "leave it out: a transfer that fails is aborted",
        "add_sdo": "the node's default SDO server, or the one of its file (0x1200)",
        "crc_cls": "leave it out",
        "curtis_hack": "mapping entries in the order of CiA 301",
        "get": "`node[...]`, which raises UnknownName",
        "get_variable": "`node[index, subindex]`",
        "items": "`for thing in node`, and `thing.address`",
        "keys": "`for thing in node`, and `thing.address`",
        "on_response": HEARD,
        "read_response": "`node.sdo.upload(index, subindex)`",
        "request_response": "`node.sdo.upload` and `download`",
        "responses": HEARD,
        "rx_cobid": "0x600 + node-ID, or what the file says (0x1200)",
        "sdo_channels": "the node's default SDO server, or the one of its file (0x1200)",
        "send_request": "`network.send_message`",
        "tx_cobid": "0x580 + node-ID, or what the file says (0x1200)",
        "values": "`for thing in node`",
    },
    "BaseNode402": {
        "TIMEOUT_CHECK_TPDO": "leave it out: the statusword is read by SDO",
        "TIMEOUT_HOMING_DEFAULT": "`homing(timeout=...)`",
        "TIMEOUT_RESET_FAULT": WAITS,
        "TIMEOUT_SWITCH_OP_MODE": WAITS,
        "TIMEOUT_SWITCH_STATE_FINAL": WAITS,
        "TIMEOUT_SWITCH_STATE_SINGLE": WAITS,
        "check_statusword": "`statusword`, which is read by SDO",
        "is_homed": "`drive402.status`",
        "on_TPDOs_update_callback": HEARD,
        "rpdo_pointers": "`node.rpdo[1]`; a drive is commanded by SDO",
        "tpdo_pointers": "`node.tpdo[1]`; a drive is asked by SDO",
        "tpdo_values": "`node.tpdo[1]`; a drive is asked by SDO",
    },
    "RemoteObject": {
        "get": "`object[...]`, which raises UnknownName",
        "get_data": "`data`",
        "readable": VARIABLE,
        "sdo_node": "keep the node that you have asked for it",
        "set_data": "`data = ...`",
        "writable": VARIABLE,
    },
    "NodeNmt": {
        "id": "`node.id`",
        "network": SHARED,
        "on_command": HEARD,
        "on_heartbeat": HEARD,
        "state_update": "`wait_for_heartbeat()`",
        "timestamp": "`network.watch(5)`, whose events have times",
    },
    "NetworkNmt": {
        "add_hearbeat_callback": "`network[5].nmt.add_heartbeat_callback(function)` for each node",
        "add_heartbeat_callback": "`network[5].nmt.add_heartbeat_callback(function)` for each node",
        "id": "0, which is all nodes",
        "network": SHARED,
        "on_command": HEARD,
        "on_heartbeat": HEARD,
        "start_node_guarding": "`network[5].nmt.start_node_guarding(0.1)` for each node",
        "state_update": "`network[5].nmt.wait_for_heartbeat()`",
        "stop_node_guarding": "`network[5].nmt.stop_node_guarding()` for each node",
        "timestamp": "`network.watch()`, whose events have times",
        "wait_for_bootup": "`network[5].nmt.wait_for_bootup()` for each node",
        "wait_for_heartbeat": "`network[5].nmt.wait_for_heartbeat()` for each node",
    },
    "EmergencyStream": {
        "callbacks": "`on(function)` and `off(function)`",
        "emcy_received": "`wait(timeout=1.0)`",
        "on_emcy": HEARD,
    },
    "Emergency": {"DESCRIPTIONS": "`text`"},
    "NetworkLss": {
        "LSS_RX_COBID": "0x7E4, fixed by CiA 305",
        "LSS_TX_COBID": "0x7E5, fixed by CiA 305",
        "network": SHARED,
        "on_message_received": HEARD,
        "responses": HEARD,
        "send_identify_non_configured_remote_slave": "`find()` for all of them, `fast_scan()` for one",
        "send_identify_remote_slave": "`send_switch_state_selective`, or `find()`",
    },
    "NodeScanner": {
        "SERVICES": "leave it out: a node is there if it answers SDO or sends heartbeats",
        "network": SHARED,
        "on_message_received": HEARD,
    },
    "NetworkSync": {
        "cob_id": "`network.sync(period, cob_id=0x80)`",
        "network": "`network` itself",
        "period": "`start(period)`, which has to be given",
    },
    "NetworkTime": {
        "cob_id": "0x100, the default of CiA 301",
        "network": "`network` itself",
    },
    "RemotePdos": {
        "export": "`node.tpdo.export(file)` and `node.rpdo.export(file)`",
        "get": "`node.pdo[...]`, which raises UnknownName",
        "items": "`node.tpdo.items()` and `node.rpdo.items()`",
        "keys": "`node.tpdo.keys()` and `node.rpdo.keys()`",
        "network": SHARED,
        "node": "keep the node that you have asked for it",
        "subscribe": "leave it out: PDOs are heard as the file, or `read()`, says",
        "values": "`node.tpdo.values()` and `node.rpdo.values()`",
    },
    "PdosOfDirection": {
        "network": SHARED,
        "node": "keep the node that you have asked for it",
        "subscribe": "leave it out: PDOs are heard as the file, or `read()`, says",
    },
    "BlockingPdoStream": {
        "callbacks": "`on(function)` and `off(function)`",
        "com_record": RECORDS,
        "data": "`network.subscribe(pdo.cob_id, function)`",
        "is_periodic": "`trans_type` and `event_timer`",
        "is_received": "`timestamp is not None`",
        "length": "the bits of `names`, by their variables: `[len(each.od) for each in pdo.map]`",
        "map_array": RECORDS,
        "on_message": HEARD,
        "pdo_node": "keep the node that you have asked for it",
        "period": "`start(period)`",
        "predefined_cob_id": "`cob_id`, which is the one in force",
        "receive_condition": "`wait_for_reception()`",
        "rtr_allowed": RECORDS,
        "subscribe": "leave it out: PDOs are heard as the file, or `read()`, says",
    },
    "PdoSignal": {
        "data": "`raw`",
        "desc": "`node[name].text_of(signal.raw)`",
        "get_data": "`raw`",
        "length": VARIABLE,
        "offset": "`canopen-workbench show` draws the bits",
        "pdo_parent": "keep the PDO that you have asked for it",
        "read": "`raw`, or `phys`",
        "set_data": "`raw = ...`",
        "write": "`raw = ...`, or `phys = ...`",
    },
}
"""What to use instead, by our class or module and canopen's name."""


def remedy_for(kind: type, name: str) -> str:
    """Return what to use in place of a name of canopen's in a class; empty for any other name."""
    return next((MISSING[each.__name__][name] for each in kind.__mro__ if name in MISSING.get(each.__name__, {})), "")


def missing(owner: str, remedy: str, name: str) -> str:
    """Return the text of the error about an attribute that is not there, with what to use in place of canopen's."""
    return f"{owner} has no attribute {name!r}{remedy and f', which canopen has; {INSTEAD}: {remedy}'}"


def module_attribute(module: str) -> Callable[[str], NoReturn]:
    """Return the `__getattr__` of a module with a name of canopen's."""

    def refuse(name: str) -> NoReturn:
        text = missing(f"module {module!r}", MISSING.get(module, {}).get(name, ""), name)
        raise AttributeError(text, name=name, obj=sys.modules.get(module))  # Python then asks "Did you mean" itself

    return refuse


class ModulesOfCanopen:
    """Lets `from eurobot_od.nmt import NmtError` find its module, which is an attribute of the package.

    It is finder and loader, without Python's base class, whose import takes longer than ours.
    Python asks for `eurobot_od.LocalNode`, too, before it says that `from eurobot_od import LocalNode` cannot be done;
    the ImportError is then the one with the remedy.
    """

    @classmethod
    def find_spec(cls, name: str, *_: object) -> ModuleSpec | None:
        """Return how a module of canopen's is loaded, None for others; raises ImportError for a missing name."""
        try:
            return ModuleSpec(name, cls()) if isinstance(cls._found(name), ModuleType) else None  # type: ignore[arg-type]
        except AttributeError as error:
            if INSTEAD in str(error):
                raise ImportError(str(error), name=name) from None
            return None

    @staticmethod
    def _found(name: str) -> object:
        package, _, inside = name.partition(".")
        return attrgetter(inside)(sys.modules[package]) if package == OURS else None

    def create_module(self, _: ModuleSpec) -> None:
        """Leave it to Python to make the module, which `exec_module` replaces."""

    def exec_module(self, module: ModuleType) -> None:
        """Put the attribute of the package in the place of the new module."""
        sys.modules[module.__name__] = self._found(module.__name__)  # type: ignore[assignment]


class NamedAsInCanopen:
    """Answers an attribute of canopen's that is missing with what to use instead, and warns of a setting like that."""

    __slots__ = ()

    _parts: ClassVar[Mapping[str, type]] = {}
    """Classes of its parts, by how a program reaches them from here: `.nmt`."""

    def _items(self) -> Iterable[str]:
        """Return the names in brackets that a program may have taken for attributes."""
        return ()

    if not TYPE_CHECKING:  # a type checker, which refuses it anyway, would take any attribute then

        def __getattr__(self, name: str) -> NoReturn:
            text = missing(type(self).__name__, remedy_for(type(self), name), name)
            found = list[str]()
            if name[0] != "_":
                found += [f"`{part}.{name}`" for part, kind in self._parts.items() if hasattr(kind, name)]
                found += [f"`[{each!r}]`" for each in self._items() if each.replace(" ", "_") == name]
            hint = f"; did you mean {' or '.join(found)}?" if found else ""
            raise AttributeError(text if INSTEAD in text else text + hint, name=name, obj=self)

        def __setattr__(self, name: str, value: object) -> None:
            # `node.sdo.MAX_RETRIES = 5`: the program runs on, and is told. Other names may be a subclass's own.
            if name.isupper() and (remedy := remedy_for(type(self), name)):
                warn(f"{name} = {value!r} has no effect on a {type(self).__name__}; {remedy}", stacklevel=2)
            object.__setattr__(self, name, value)


# Objects as files


class WrittenAtItsEnd(BytesIO):
    """Bytes that `write` gets when the file is closed, unless an exception ends its `with`."""

    def __init__(self, write: Callable[[bytes], object]) -> None:
        super().__init__()
        self._write = write

    def close(self) -> None:
        if not self.closed:
            self._write(self.getvalue())
        super().close()

    def __exit__(self, kind: object, *_: object) -> None:
        if kind is None:
            self.close()
        super().close()


def opened(mode: str, encoding: str, read: Callable[[], bytes], write: Callable[[bytes], object]) -> IO[Any]:
    """Return a file to read (`r`, `rb`) what `read` returns, or to write (`wb`) what `write` gets at its end.

    Raises LocalError for another mode.
    """
    if mode == "wb":
        return WrittenAtItsEnd(write)
    if mode not in ("r", "rt", "rb"):
        raise LocalError(f"an object is opened with `r`, `rb` or `wb`, not with {mode!r}")
    return BytesIO(read()) if mode == "rb" else TextIOWrapper(BytesIO(read()), encoding)
