"""Calls in other processes: all results, the first exception, and Ctrl-C left to the process that asked."""

import os
import signal
import time

import pytest

from socialnav_mj.processes import STOPPING, Beside, Interruption, in_processes, stoppable


def square(number):
    if number < 0:
        raise ValueError(f"no square of {number}")
    return number * number


def hears(_):
    return os.getpid(), [n for n in STOPPING if signal.getsignal(n) is not signal.SIG_IGN]


@pytest.mark.parametrize("n_jobs", [1, 2])
def test_all_results_come_and_exceptions_are_raised_here(n_jobs):
    assert sorted(in_processes(square, [(k,) for k in range(7)], n_jobs=n_jobs)) == [k * k for k in range(7)]
    assert list(in_processes(square, [], n_jobs=n_jobs)) == []
    with pytest.raises(ValueError, match="no square of -1"):
        list(in_processes(square, [(1,), (-1,)], n_jobs=n_jobs))


def test_processes_are_deaf_to_signals_and_this_one_is_not():
    before = [signal.getsignal(n) for n in STOPPING]
    found = dict(in_processes(hears, [(k,) for k in range(4)], n_jobs=2))
    assert os.getpid() not in found and not any(found.values())
    assert [signal.getsignal(n) for n in STOPPING] == before
    assert not {*STOPPING} & signal.pthread_sigmask(signal.SIG_BLOCK, ())


def arguments_while_a_signal_comes():
    """The first argument is drawn while the processes start."""
    os.kill(os.getpid(), signal.SIGTERM)
    yield (2,)


@pytest.mark.parametrize("n_jobs", [1, 2])
def test_signal_that_comes_while_processes_start_is_not_lost(n_jobs):
    with pytest.raises(Interruption), stoppable():
        list(in_processes(square, arguments_while_a_signal_comes(), n_jobs=n_jobs))


def stop_twice(number):
    try:
        os.kill(os.getpid(), number)
    finally:
        os.kill(os.getpid(), signal.SIGTERM)


@pytest.mark.parametrize("number", [signal.SIGTERM, signal.SIGHUP])
def test_signals_stop_a_block_once_and_are_as_before_afterwards(number):
    """The second one does not break what the first has begun."""
    with pytest.raises(Interruption) as caught, stoppable():
        stop_twice(number)
    assert caught.value.number == number
    assert signal.getsignal(number) == signal.SIG_DFL


def test_signal_that_is_to_be_ignored_stays_ignored():
    """What nohup does."""
    before = signal.signal(signal.SIGHUP, signal.SIG_IGN)
    try:
        with stoppable():
            os.kill(os.getpid(), signal.SIGHUP)
    finally:
        signal.signal(signal.SIGHUP, before)


def test_process_beside_this_one_answers_in_turn_and_ends_whatever_it_does():
    beside = Beside()
    numbers = [beside.ask(os.getpid).result() for _ in range(2)]
    assert numbers[0] == numbers[1] != os.getpid()
    with pytest.raises(ValueError, match="invalid literal"):
        beside.ask(int, "x").result()
    endless = beside.ask(time.sleep, 60.0)
    while not endless.running():
        time.sleep(0.01)
    time.sleep(0.2)
    begin = time.monotonic()
    beside.close()
    assert time.monotonic() - begin < 30.0
    with pytest.raises(ProcessLookupError):
        os.kill(numbers[0], 0)
