"""What ends a node."""

from __future__ import annotations

import signal

import pytest

from deeptruck_nodes import node


@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM, signal.SIGHUP])
@pytest.mark.parametrize("ignored", [True, False])
def test_a_node_leaves_in_order_by_signals_unless_a_hang_up_is_ignored(
    number: signal.Signals, ignored: bool
) -> None:
    before = {n: signal.getsignal(n) for n in (signal.SIGINT, signal.SIGTERM, signal.SIGHUP)}
    try:
        signal.signal(signal.SIGHUP, signal.SIG_IGN if ignored else signal.SIG_DFL)
        stop = node._Stop()
        stop.is_made = True
        signal.raise_signal(number)
        assert stop.asked is not (ignored and number == signal.SIGHUP)
    finally:
        for n, handler in before.items():
            signal.signal(n, handler)


def alternates(numbers: list[int]) -> bool:
    heard = node.Publishers()
    return [heard.are_two(number) for number in numbers][-1]


def test_messages_of_two_publishers_alternate_between_two_series() -> None:
    assert alternates([1000, 1, 1001, 2])
    assert alternates([500, 500, 501, 501, 502, 502])  # begun together
    assert alternates([1000, 950, 1001, 951, 1002])
    assert alternates([*range(1, 60), 7, 60, 61, 62, 63, 8])  # one is slow


def test_one_publisher_may_lose_messages_and_be_restarted() -> None:
    assert not alternates([1, 2, 3, 40, 41, 200, 201])
    assert not alternates([1000, 1001, 1, 2, 3, 4])
    assert not alternates([*range(1, 50), *range(1, 30), *range(31, 200)])  # twice, its first ones missed
    assert not alternates([1000, 1001, *range(1, 1000), *range(1001, 1200)])  # past the number of the old one
    assert not node.Publishers().are_two(None)
