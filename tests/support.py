"""What tests share: how a part that a machine lacks is named, how a file is loaded."""

import os
from datetime import datetime

import pytest


def require(part: str, available: bool, hint: str) -> None:
    """Skip the test when `part` is missing, or fail it when SHIPNET_REQUIRE lists `part`."""
    if available:
        return
    if part in os.environ.get("SHIPNET_REQUIRE", "").split(","):
        pytest.fail(f"{part}: {hint}", pytrace=False)
    pytest.skip(f"{part}: {hint}")


def load(upload: object, content: bytes, name: str = "a.csv") -> None:
    """Give a file to an upload button as the browser does."""
    about = {"type": "", "size": len(content), "last_modified": datetime(2026, 1, 1)}
    upload.value = [{"name": name, "content": memoryview(content), **about}]
