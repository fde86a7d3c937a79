"""Headless Chromium for pages written by tests; without one, tests are skipped, but fail in CI."""

from __future__ import annotations

import os
import shutil
from contextlib import contextmanager
from typing import TYPE_CHECKING

import pytest
from selenium import webdriver

if TYPE_CHECKING:
    from collections.abc import Iterator
    from pathlib import Path

FLAGS = (
    *("--headless", "--no-sandbox", "--disable-gpu", "--disable-quic", "--no-first-run"),
    *("--disable-background-networking", "--disable-component-update", "--disable-sync"),
    *("--disable-dev-shm-usage", "--disable-default-apps", "--disable-extensions"),
    # WebGL in software: machines that run tests have no graphics card
    *("--use-gl=angle", "--use-angle=swiftshader", "--enable-unsafe-swiftshader"),
    "--force-device-scale-factor=1",
)


def require_browser() -> tuple[str, str]:
    """Return paths of Chromium and its driver; without them skip the test, or fail in CI."""
    browser, driver = shutil.which("chromium"), shutil.which("chromedriver")
    if browser and driver:
        return browser, driver
    missing = "chromium and chromium-driver, Debian's packages, are not installed"
    if os.environ.get("CI") == "true":
        pytest.fail(f"{missing}; .ci/run installs them")
    pytest.skip(missing)


@contextmanager
def opened_browser(profile: Path) -> Iterator[webdriver.Chrome]:
    """Open a Chromium with a separate profile."""
    browser, driver = require_browser()
    options = webdriver.ChromeOptions()
    options.binary_location = browser
    for flag in (*FLAGS, f"--user-data-dir={profile}"):
        options.add_argument(flag)
    options.set_capability("goog:loggingPrefs", {"browser": "ALL"})
    opened = webdriver.Chrome(options, webdriver.ChromeService(driver))
    try:
        yield opened
    finally:
        opened.quit()


def resize(browser: webdriver.Chrome, width: int, height: int) -> None:
    """Set the size of the page, which may be narrower than any window."""
    size = {"width": width, "height": height, "deviceScaleFactor": 1, "mobile": False}
    browser.execute_cdp_cmd("Emulation.setDeviceMetricsOverride", size)


def colour_scheme(browser: webdriver.Chrome, scheme: str) -> None:
    """Emulate light or dark colours."""
    features = [{"name": "prefers-color-scheme", "value": scheme}]
    browser.execute_cdp_cmd("Emulation.setEmulatedMedia", {"features": features})
