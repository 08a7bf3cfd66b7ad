"""Killed in the midst of storing: every restart finds one whole configuration."""

from __future__ import annotations

import os
from pathlib import Path

import kill_store
import pytest

from eurobot_od.device.device import Device
from eurobot_od.device.objects import FileStore
from eurobot_od.od.dictionary import Dictionary
from tests.eds_text import DEVICE_TYPE, record


@pytest.mark.long
@pytest.mark.skipif(not hasattr(os, "fork"), reason="kills a forked process")
def test_every_restart_finds_a_whole_configuration(tmp_path: Path) -> None:
    assert kill_store.run(times=15, seed=3, folder=tmp_path) == []


def test_the_settings_of_two_generations_are_told_apart(tmp_path: Path) -> None:
    settings = (record(index, "Setting", (1, "UNSIGNED16", "1")) for index, _ in kill_store.SETTINGS)
    text = DEVICE_TYPE + record(0x1010, "Store parameters", (1, "UNSIGNED32", "1")) + "".join(settings)
    dictionary = Dictionary.read(text.encode(), Path("some.eds"), 5)
    store = FileStore(tmp_path / "some.dcf", dictionary)
    device = Device(dictionary, store)
    kill_store.store_once(device, 5)
    assert kill_store.restarted(store, dictionary) == {5}
    store.save(device.objects.configuration() | {kill_store.SETTINGS[0]: 6}, 1)
    assert kill_store.restarted(store, dictionary) == {5, 6}
