"""What all tests have: dictionaries read once, Ctrl-C, folders of their own, hypothesis untimed."""

from __future__ import annotations

import os
import signal
from collections.abc import Callable, Iterator
from functools import lru_cache, wraps
from pathlib import Path

import pytest
from hypothesis import HealthCheck, settings

from eurobot_od.od.dictionary import Dictionary

# No test may depend on how fast the machine is. In CI the same inputs are tried each time: what a change did not break
# stays green. Everywhere else they are other ones each time.
CI = os.environ.get("CI") == "true"
untimed = settings(deadline=None, derandomize=CI, suppress_health_check=[HealthCheck.too_slow])
settings.register_profile("suite", untimed, max_examples=16)
settings.register_profile("campaign", untimed, max_examples=300)  # pytest --hypothesis-profile=campaign
settings.load_profile("suite")

# Half of the tests' time was spent on reading the same few EDS files. A dictionary is a value, so what is read again
# with nothing but its text, name and node-ID is the same one.
read_afresh: Callable[..., Dictionary] = Dictionary.read.__func__  # type: ignore[attr-defined]
read_once: Callable[..., Dictionary] = lru_cache(maxsize=100)(read_afresh)


@wraps(read_afresh)
def read(
    cls: type[Dictionary],
    data: bytes,
    file: Path,
    node_id: int | None = None,
    name: str = "",
    modules: object = None,
    patches: object = (),
) -> Dictionary:
    if modules is None and not patches:
        return read_once(cls, data, file, node_id, name)
    return read_afresh(cls, data, file, node_id, name, modules, patches)


Dictionary.read = classmethod(read)  # type: ignore[assignment]


@pytest.fixture(scope="session", autouse=True)
def ctrl_c() -> Iterator[None]:
    """Ends the tests' processes also where whoever started the tests ignores it: nohup, a job in the background."""
    before = signal.signal(signal.SIGINT, signal.default_int_handler)
    yield
    signal.signal(signal.SIGINT, before)


@pytest.fixture(scope="session", autouse=True)
def own_folders(tmp_path_factory: pytest.TempPathFactory) -> Iterator[None]:
    """Keeps the tests, and what they start, from the library and the cache of whoever runs them."""
    with pytest.MonkeyPatch.context() as patch:
        for variable in ("XDG_DATA_HOME", "XDG_CACHE_HOME", "LOCALAPPDATA"):
            patch.setenv(variable, str(tmp_path_factory.mktemp(variable)))
        yield


@pytest.fixture(autouse=True)
def sigterm() -> Iterator[None]:
    """Puts back what SIGTERM does: some commands take it for their whole process."""
    before = signal.getsignal(signal.SIGTERM)
    yield
    signal.signal(signal.SIGTERM, before)


def pytest_runtest_setup(item: pytest.Item) -> None:
    """Skip on Windows what needs something that it does not have."""
    if os.name == "nt" and item.get_closest_marker("posix"):
        pytest.skip("Windows has no such thing")
