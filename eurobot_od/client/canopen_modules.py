"""Modules of the canopen package, with the names in them that programs use: `canopen.nmt.NmtError`."""

from types import SimpleNamespace

from canopen.nmt import NMT_STATES

from eurobot_od.client.network import BaseNode402
from eurobot_od.client.streams import Emergency
from eurobot_od.errors import HeartbeatLost, RemoteError

emcy = SimpleNamespace(EmcyError=Emergency)
lss = SimpleNamespace(LssError=RemoteError)
nmt = SimpleNamespace(NmtError=HeartbeatLost, NMT_STATES=NMT_STATES)
profiles = SimpleNamespace(p402=SimpleNamespace(BaseNode402=BaseNode402))
