"""Errors of SDO transfers under the names that canopen has."""

from eurobot_od.errors import NoAnswer as SdoCommunicationError
from eurobot_od.errors import NodeRefused as SdoAbortedError
from eurobot_od.errors import RemoteError as SdoError

__all__ = ["SdoAbortedError", "SdoCommunicationError", "SdoError"]
