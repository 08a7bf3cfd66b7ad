"""One browser for the tests of the page, which are skipped by name where there is none; CI has one."""

from __future__ import annotations

import os
from collections.abc import Iterator

import pytest
from interop_rows.tools import BROWSERS

from tests.web.browser import PROGRAM, Browser, Page, running


@pytest.hookimpl(tryfirst=True)  # before pytest leaves out what is marked
def pytest_collection_modifyitems(items: list[pytest.Item]) -> None:
    """Mark what needs a browser as long: without a graphics card the processor draws each picture."""
    for item in items:
        if "browser" in getattr(item, "fixturenames", ()):
            item.add_marker(pytest.mark.long)


@pytest.fixture(scope="session")
def browser() -> Iterator[Browser]:
    if PROGRAM is None:
        assert not os.environ.get("CI"), "CI has to have a browser"
        pytest.skip(f"no browser: none of {', '.join(BROWSERS)}")
    with running() as started:
        yield started


@pytest.fixture
def window(browser: Browser) -> Iterator[Page]:
    """A window of its own, in which nothing may go wrong unseen."""
    page = browser.page()
    page.size(1600)
    yield page
    complaints = page.complaints
    page.close()
    assert complaints == []
