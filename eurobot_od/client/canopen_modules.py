"""Modules of the canopen package with the names in them that programs use: `canopen.nmt.NmtError`."""

from types import ModuleType

import canopen.emcy
import canopen.lss
import canopen.nmt
from canopen.profiles import p402

from eurobot_od.canopen_names import OURS, module_attribute
from eurobot_od.client.network import BaseNode402, Network, RemoteNode
from eurobot_od.client.streams import Emergency
from eurobot_od.errors import HeartbeatLost, RemoteError


def _module(name: str, /, constants: ModuleType | None = None, **names: object) -> ModuleType:
    """Return a module with the constants of one of canopen's, and names of ours."""
    made = ModuleType(f"{OURS}.{name}")
    copied = {each: value for each, value in vars(constants).items() if each.isupper()} if constants else {}
    # With a path it is a package: `from` asks for a name that is missing as for a module, see ModulesOfCanopen.
    vars(made).update(copied, **names, __path__=[], __getattr__=module_attribute(made.__name__))
    return made


emcy = _module("emcy", canopen.emcy, EmcyError=Emergency)
lss = _module("lss", canopen.lss, LssError=RemoteError)
network = _module("network", Network=Network)
nmt = _module("nmt", canopen.nmt, NmtError=HeartbeatLost)
node = _module("node", RemoteNode=RemoteNode, remote=_module("node.remote", RemoteNode=RemoteNode))
profiles = _module(
    "profiles",
    p402=_module("profiles.p402", BaseNode402=BaseNode402, OperationMode=p402.OperationMode, State402=p402.State402),
)
