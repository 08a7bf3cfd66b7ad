"""The robot's messages as the EDS files of a dialect map them; the public `eurobot_od.robot.Protocol`."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

from eurobot_od.pdo.protocol import Protocol
from eurobot_od.robot import dialects
from eurobot_od.robot.model.messages import CATALOGUE

if TYPE_CHECKING:
    from eurobot_od.traffic.meaning import Decoder


class EurobotProtocol(Protocol):
    """A protocol with the 23 messages of the document's Table 5 as types."""

    CATALOGUE = CATALOGUE

    @classmethod
    def load(cls, dialect: str | Path | None = None) -> EurobotProtocol:
        """Load all EDS files of a dialect by its name or folder; raises UnknownName, DictionaryError."""
        return cls.of_devices(dialects.load_all(dialect), CATALOGUE)


def decoder(dialect: str | Path | None = None) -> Decoder:
    """Return the decoder of frames by the EDS files of a dialect; raises UnknownName, DictionaryError."""
    from eurobot_od.traffic.meaning import Decoder  # here, as `show` does not need it

    return Decoder(dialects.load_all(dialect), CATALOGUE)
