"""Checks the clock of a log: frames with wrong stamps, and restarted sessions.

A log often consists of several sessions: a logger restarts at zero, or its clock is set while it runs. A
single frame may also have a wrong stamp. Each jump is judged with the frames after it: if time soon returns,
the frames in between have wrong stamps and are omitted; if it does not, a new piece begins.
"""

from __future__ import annotations

from collections.abc import Iterator

from deeptruck_core.account import Account
from deeptruck_core.constants import APART_S, BACK_S, DAY_S, RETURN_S, TRUSTED
from truck_bridge.can_logs.frames import Frame
from truck_bridge.errors import InputError

HOLE_S = 1.0  # between frames; some message of every J1939 bus comes ten times a second
PAUSE_S = DAY_S  # a longer jump ahead is no pause of the truck but a clock that was set
SELDOM = 1 / 10  # of the frames; where fewer are earlier than the one before, a clock begins again
BACK_AND_FORTH = 1 / 3  # of the frames; where more go back, and all lie within HOLE_S, times are differences


def in_pieces(frames: Iterator[Frame], account: Account, *, ascending: bool) -> Iterator[Frame]:
    """The frames except those with wrong stamps, which `account` counts, together with the time spans and the
    cuts.

    With `ascending`, a session whose clock was set back is moved to APART_S after the one before it;
    otherwise frames keep the log's times.
    """
    clock = _Clock(account, ascending)
    held: list[Frame] = []  # behind a jump that may be a wrong stamp
    for frame in frames:
        if held and clock.has_returned(held, frame):
            where = "ahead of" if held[0].time > clock.last else "behind"
            account.total.set_aside(
                f"frames stamped far {where} their neighbours", f"at {held[0].time:.3f} s", len(held)
            )
            held = []
        elif held or clock.jumps(frame):
            held.append(frame)
            if len(held) >= TRUSTED:
                yield from map(clock.placed, held)
                held = []
            continue
        yield clock.placed(frame)
    yield from map(clock.placed, held)
    clock.finish()


class _Clock:
    def __init__(self, account: Account, ascending: bool) -> None:
        self.last = 0.0  # s, of the frame before, as the log has it
        self._account, self._ascending = account, ascending
        self._first: float | None = None
        self._begun = self._latest = self._shift = 0.0
        self._overtaken, self._returns, self._most = 0, 0, 0.0

    def jumps(self, frame: Frame) -> bool:
        return self._first is not None and not -BACK_S <= frame.time - self.last <= HOLE_S

    def has_returned(self, held: list[Frame], frame: Frame) -> bool:
        """Whether time has returned to that before the held frames."""
        ahead = held[0].time > self.last
        step = frame.time - held[-1].time
        opposite = step < -BACK_S if ahead else step > HOLE_S
        return opposite and -BACK_S <= frame.time - self.last <= RETURN_S

    def placed(self, frame: Frame) -> Frame:
        """The frame with its time on the clock of those before it; notes the end of a piece."""
        time = frame.time
        if self._first is None:
            self._first = self._begun = self._latest = self.last = time
        step = time - self.last
        if step < -BACK_S or step > PAUSE_S:
            self._close()
            way = f"back by {-step:.3f} s" if step < 0 else f"ahead by {step:.0f} s"
            self._account.remarks.append(
                f"time jumps {way} behind {self.last:.3f} s: several logs in one, or a clock that was set; "
                "a new piece begins"
            )
            if self._ascending:
                self._shift = self._latest + self._shift + APART_S - time
            self._begun = self._latest = time
        elif step > HOLE_S:
            self._close()
            self._begun = time
        elif time < self._latest:
            self._overtaken += 1
            self._returns += step < 0.0
            self._most = max(self._most, self._latest - time)
        self.last = time
        if time > self._latest:
            self._latest = time
        return frame._replace(time=time + self._shift) if self._shift else frame

    def _check(self) -> None:
        """Raises InputError for times that cannot be a clock because they jump back and forth without
        progress."""
        frames = self._account.total.read
        if self._latest - self._begun < HOLE_S and self._overtaken > max(TRUSTED, BACK_AND_FORTH * frames):
            if self._returns < SELDOM * frames:
                raise InputError(
                    f"{self._account.source}: times begin again {self._returns} times, and none lasts longer "
                    f"than {self._latest - self._begun:.3g} s: a part of the clock was not recorded; record "
                    "whole times"
                )
            raise InputError(
                f"{self._account.source}: the times of {self._overtaken} of {frames} frames go back; are "
                "they differences ('candump -t d')? Record with 'candump -t a' or 'candump -l'"
            )

    def _close(self) -> None:
        first = self._first or 0.0
        self._account.spans.append((self._begun - first, self._latest - first))

    def finish(self) -> None:
        if self._first is not None:
            self._close()
        self._check()
        if self._overtaken:
            self._account.remarks.append(
                f"time runs backwards {self._overtaken} times, by {self._most:.3f} s at most: "
                "frames keep their own stamps"
            )
