"""Calls in other processes: all results, the first exception, and Ctrl-C left to the process that asked."""

import os
import signal

import pytest

from socialnav_mj.processes import in_processes


def square(number):
    if number < 0:
        raise ValueError(f"no square of {number}")
    return number * number


def hears_interrupts(_):
    return os.getpid(), signal.getsignal(signal.SIGINT) is not signal.SIG_IGN


@pytest.mark.parametrize("n_jobs", [1, 2])
def test_all_results_come_and_exceptions_are_raised_here(n_jobs):
    assert sorted(in_processes(square, [(k,) for k in range(7)], n_jobs=n_jobs)) == [k * k for k in range(7)]
    assert list(in_processes(square, [], n_jobs=n_jobs)) == []
    with pytest.raises(ValueError, match="no square of -1"):
        list(in_processes(square, [(1,), (-1,)], n_jobs=n_jobs))


def test_processes_are_deaf_to_interrupts_and_this_one_is_not():
    before = signal.getsignal(signal.SIGINT)
    found = dict(in_processes(hears_interrupts, [(k,) for k in range(4)], n_jobs=2))
    assert os.getpid() not in found and not any(found.values())
    assert signal.getsignal(signal.SIGINT) is before
