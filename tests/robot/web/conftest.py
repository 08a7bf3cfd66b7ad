"""The browser of the page's tests, for those of the robot's view too."""

from tests.web.conftest import browser, pytest_collection_modifyitems, window

__all__ = ["browser", "pytest_collection_modifyitems", "window"]
