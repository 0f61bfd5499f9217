"""Signals that a command hears, and those that it was started to ignore."""

from __future__ import annotations

import signal

import pytest

from fab.command import Interrupts
from fab.exports.whole_folder import ENDING_SIGNALS
from fab.workers import worker_pool


@pytest.fixture
def under_nohup():
    """SIGHUP ignored, as nohup leaves it to the program that it starts."""
    before = signal.signal(signal.SIGHUP, signal.SIG_IGN)
    yield
    signal.signal(signal.SIGHUP, before)


@pytest.mark.parametrize("number", ENDING_SIGNALS)
def test_a_signal_is_raised_and_remembered(number):
    before = signal.getsignal(number)
    interrupts = Interrupts()
    with interrupts.handling(), pytest.raises(KeyboardInterrupt):
        signal.raise_signal(number)
    assert interrupts.signal == number and signal.getsignal(number) == before


def test_what_is_ignored_stays_ignored_and_the_others_are_heard(under_nohup):
    interrupts = Interrupts()
    with interrupts.handling():
        signal.raise_signal(signal.SIGHUP)
        assert interrupts.signal is None
        with pytest.raises(KeyboardInterrupt):
            signal.raise_signal(signal.SIGTERM)
    assert signal.getsignal(signal.SIGHUP) is signal.SIG_IGN


def test_workers_ignore_what_their_command_was_started_to_ignore(under_nohup):
    with worker_pool(1) as workers:
        found = [workers.submit(signal.getsignal, number).result() for number in (signal.SIGHUP, signal.SIGTERM)]
    assert found == [signal.SIG_IGN, signal.SIG_DFL]


def test_workers_end_with_a_terminal_that_is_closed():
    with worker_pool(1) as workers:
        assert workers.submit(signal.getsignal, signal.SIGHUP).result() is signal.SIG_DFL
