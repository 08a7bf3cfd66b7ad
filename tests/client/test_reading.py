"""Reading all of a node: what it refuses is reported and left out, and its DCF makes another node like it."""

from __future__ import annotations

from datetime import datetime
from pathlib import Path

import pytest

from eurobot_od.client.configure import configure, difference
from eurobot_od.client.description import from_file
from eurobot_od.client.reading import ObjectReading, dcf_of_node, parameters, read_all, readable
from eurobot_od.errors import NoAnswer
from eurobot_od.od import dcf
from eurobot_od.od.document import parse
from eurobot_od.od.objects import address_of
from tests.client.peers import DRIVE, master_on, new_channel, robot, stock_drive

DESCRIPTION = from_file(DRIVE)
WRITTEN = {(0x1017, 0): b"\xf4\x01", (0x2101, 1): b"\x84\x03"}


def test_everything_that_can_be_read_is_read() -> None:
    with robot("drive") as channel, master_on(channel) as master:
        readings = {address_of(each.thing): each for each in read_all(master.node(2), readable(DESCRIPTION.dictionary))}
    assert readings[0x1008, 0].value == "Eurobot 2014 drive"
    assert readings[0x1403, 1].value == 8
    assert readings[0x1003, 1] == ObjectReading(readings[0x1003, 1].thing, None, "No data available")
    assert (0x1021, 0) not in readings  # the EDS itself is not a value to look at


def test_parameters_are_what_can_be_set_and_is_no_process_data() -> None:
    addresses = {address_of(thing) for thing in parameters(DESCRIPTION.dictionary)}
    assert {(0x1017, 0), (0x1403, 1), (0x1603, 0), (0x2101, 1)} <= addresses
    assert not {(0x1018, 1), (0x1010, 1), (0x1003, 0), (0x1020, 1), (0x2000, 1)} & addresses


def test_the_dcf_of_one_drive_makes_another_like_it(tmp_path: Path) -> None:
    file = tmp_path / "drive.dcf"
    with robot("drive") as channel, master_on(channel) as master:
        for address, data in WRITTEN.items():
            master.node(2).download(address, data)
        made, left_out = dcf_of_node(master.node(2), DESCRIPTION.dictionary, 500, "drive")
    assert (left_out, made.files) == ([], {})
    assert dcf.missing(parse(made.content.decode())) == []
    file.write_bytes(made.content)
    with robot("drive") as channel, master_on(channel) as master:
        node = master.node(2)
        assert {address_of(each.thing): each.after for each in difference(node, from_file(file)).changes} == WRITTEN
        configure(node, from_file(file), datetime(2014, 5, 28))
        assert [node.upload(address) for address in WRITTEN] == [*WRITTEN.values()]


def test_what_the_node_refuses_is_left_out_and_told() -> None:
    with stock_drive() as (channel, node), master_on(channel) as master:
        del node.object_dictionary[0x2101]
        made, left_out = dcf_of_node(master.node(2), DESCRIPTION.dictionary, 500, "drive")
    assert {address_of(each.thing)[0] for each in left_out} == {0x2101}
    assert {each.refusal for each in left_out} == {"Object does not exist"}
    assert b"ParameterValue=1000" in made.content


def test_a_node_that_does_not_answer_ends_the_reading() -> None:
    with master_on(new_channel(), 0.01) as master, pytest.raises(NoAnswer):
        dcf_of_node(master.node(2), DESCRIPTION.dictionary, 500, "drive")
