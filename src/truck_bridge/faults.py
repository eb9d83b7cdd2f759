"""Active faults on a bus. Time is an argument.

A code or lamp is active from the first DM1 that reports it until HOLD_S after the last one: J1939-73 requires
a report every second, and two controllers may take turns at one address.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import NamedTuple

from truck_bridge.j1939.diagnostics import DERATE, LAMPS, Code, Report

HOLD_S = 5.0  # five periods of a DM1; the cab controller of a recorded truck takes 4.8 s
MOST = 100  # faults kept at a time; further ones are counted until some have ended


class Fault(NamedTuple):
    """A code, or the name of a lamp that is on, as reported by one controller."""

    source: int
    what: Code | str


@dataclass
class _Span:
    """The time since which a fault has been active, and of its last report."""

    since: float
    last: float


class ActiveFaults:
    """The faults that DM1 messages report as active. Pass each DM1 to `take`; `active` and `channels` return
    the state at a time. `left_out` counts reports of faults beyond MOST."""

    def __init__(self) -> None:
        self._spans: dict[Fault, _Span] = {}  # in order of the last report
        self._received = False
        self.left_out = 0

    def take(self, source: int, report: Report, now: float) -> None:
        """Process one DM1 of a controller."""
        self._received = True
        while self._spans and now - self._spans[oldest := next(iter(self._spans))].last > HOLD_S:
            del self._spans[oldest]
        for what in report.active:
            fault = Fault(source, what)
            span = self._spans.pop(fault, None) or _Span(now, now)
            if len(self._spans) < MOST:
                span.last = now
                self._spans[fault] = span
            else:
                self.left_out += 1

    def active(self, now: float) -> list[Fault]:
        """Oldest first; faults that began simultaneously in the order of their message."""
        spans = sorted(self._spans.items(), key=lambda item: item[1].since)
        return [fault for fault, span in spans if now - span.last <= HOLD_S]

    def channels(self, now: float) -> dict[str, float]:
        """The values of deeptruck's fault channels, the newest code included; empty before the first DM1."""
        if not self._received:
            return {}
        active = self.active(now)
        codes = [fault.what for fault in active if isinstance(fault.what, Code)]
        newest = codes[-1] if codes else Code(0, 0)
        lamps = {fault.what for fault in active}
        return {
            "fault_count": float(len(codes)),
            "fault_spn": float(newest.spn),
            "fault_fmi": float(newest.fmi),
            "derate_active": float(any(DERATE in code.readings for code in codes)),
            **{lamp: float(lamp in lamps) for lamp in LAMPS},
        }
