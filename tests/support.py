"""What tests share: how a part that a machine lacks is named."""

import os

import pytest


def require(part: str, available: bool, hint: str) -> None:
    """Skip the test when `part` is missing, or fail it when SHIPNET_REQUIRE lists `part`."""
    if available:
        return
    if part in os.environ.get("SHIPNET_REQUIRE", "").split(","):
        pytest.fail(f"{part}: {hint}", pytrace=False)
    pytest.skip(f"{part}: {hint}")
