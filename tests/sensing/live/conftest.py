"""The dot tracker is compiled before the first test, so that no test's patience is spent on that."""

import pytest

from sensing.live.core.warm_up import warm_up


@pytest.fixture(scope="session", autouse=True)
def compiled() -> None:
    warm_up(lambda _: None)
