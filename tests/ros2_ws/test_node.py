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
