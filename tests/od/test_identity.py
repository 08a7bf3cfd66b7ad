"""What a device has shown of itself against its file, and which nodes of some files are on a bus."""

from __future__ import annotations

import pytest

from eurobot_od.od.identity import Identity, absence, misfit
from tests.client.servo import SERVO


@pytest.mark.parametrize(
    ("identity", "device_type", "text"),
    [
        (Identity(), None, ""),
        (Identity(vendor=5), None, ""),  # the file says no vendor-ID
        (Identity(), SERVO.number((0x1000, 0)), ""),
        (Identity(), 0x191, "device type 0x00000191, not 0x00020192"),
        (Identity(), 0, ""),
    ],
    ids=["the same", "not said", "same type", "other type", "no type"],
)
def test_a_device_that_is_not_the_one_of_its_file_is_told(
    identity: Identity, device_type: int | None, text: str
) -> None:
    assert misfit(SERVO, identity, device_type) == text


@pytest.mark.parametrize(
    ("expected", "heard", "text"),
    [
        ([6], [5], "node 5 is on this bus, node 6 is not"),
        ([6, 7], [5, 4], "nodes 4, 5 are on this bus, nodes 6, 7 are not"),
        ([5, 6], [5], ""),
        ([6], [], ""),
        ([5], [5, 6], ""),
    ],
    ids=["another", "others", "one missing", "nobody", "all there"],
)
def test_a_missing_node_is_reported_beside_an_unexpected_one(expected: list[int], heard: list[int], text: str) -> None:
    assert absence(expected, heard) == text
