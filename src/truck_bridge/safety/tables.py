"""What the safety core is told about a vehicle: plain numbers, checked when the vehicle is loaded.

Units are those of the signals: m/s, rad/s, and for an axis the unit of its demand on the wire.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

SIGNED = (1 << 56) - 1  # bytes 1 to 7; byte 8 holds counter and checksum


@dataclass(frozen=True)
class Field:
    """A number in the 64-bit little endian word of a frame."""

    start: int
    bits: int
    scale: float
    offset: float
    last: int  # highest raw value that is a number; above it lie error and not available

    @property
    def mask(self) -> int:
        """Its bits in the word."""
        return ((1 << self.bits) - 1) << self.start

    def read(self, word: int) -> float | None:
        """The number, or None where there is none."""
        raw = (word >> self.start) & ((1 << self.bits) - 1)
        return self.offset + self.scale * raw if raw <= self.last else None


@dataclass(frozen=True)
class Limits:
    """Envelope over speed (linear between the points, constant outside) and how fast a demand may move in
    it.
    """

    speed: tuple[float, ...]
    low: tuple[float, ...]
    high: tuple[float, ...]
    rate: float  # unit/s, while engaged
    fade: float  # unit/s towards rest, in a graded release
    jerk: float  # unit/s^2, change of the rate


@dataclass(frozen=True)
class Axis:
    """One thing that may be commanded, by one message."""

    name: str
    can_id: int
    period_s: float
    demand: Field
    active: int  # bytes 1 to 7 of a commanding frame, demand bits zero
    release: int  # bytes 1 to 7 of the frame that hands back (mode 0, demand 0xFF..)
    check: str  # none, tsc1 or xbr
    limits: Limits
    rest: float = 0.0  # the demand that asks for nothing
    idle_at_rest: bool = False  # rest is sent as the release frame (XBR of 0 would hold the speed)
    start_from: str = ""  # heard signal (same unit) where the demand starts at engagement
    holds_beyond: float = math.inf  # signed demand beyond which only a hazard is braked for

    @property
    def brakes(self) -> bool:
        """Whether its demands slow the truck: all but those on the engine."""
        return self.name != "engine"

    def takes(self, demand: float) -> bool:
        """Whether a demand lies in the envelope of some speed."""
        return min(self.limits.low) <= demand <= max(self.limits.high)


@dataclass(frozen=True)
class Measured:
    """One signal of a heard message, and what a truck can produce: range, change, standstill."""

    name: str
    field: Field
    low: float
    high: float
    fastest: float = math.inf  # greatest change, unit/s
    still_s: float = math.inf  # longest that a sound sensor repeats one value exactly
    rises: float = math.inf  # greatest rise, unit/s


@dataclass(frozen=True)
class Heard:
    """One message that must be heard. `key` is parameter group and source address, pgn << 8 | source."""

    name: str
    key: int
    period_s: float
    timeout_s: float
    signals: tuple[Measured, ...]
    check: str = "none"


@dataclass(frozen=True)
class Override:
    """A driver's signal by which the driver takes over. While a hazard is braked for hard, only one that is
    there for `held_s` does, at `firm` or above: a single frame is none.
    """

    name: str
    least: float  # from which it takes over
    firm: float
    held_s: float = 0.28  # four frames of 0.1 s, less their jitter
    brakes: bool = False  # the driver brakes: ours goes on beneath, until the driver lifts the foot


@dataclass(frozen=True)
class Allowed:
    """What another controller may demand of one axis. `key` is the identifier without its priority."""

    name: str  # "brake to engine"
    key: int
    modes: tuple[int, ...]  # override control modes of TSC1 (J1939-71, SPN 695)
    longest_s: float  # a demand
    period_s: tuple[float, float]  # between messages, least (on average) and most


@dataclass(frozen=True)
class Obeyed:
    """What a controller says that it obeys: a heard signal, and its values where that is the controller
    itself or us. Where the signal is an address, the controller of `axis` obeys us from a demand on.
    """

    signal: str
    explained: tuple[float, ...]
    axis: str = ""
    from_demand: float = 10.0  # absolute, in the unit of the axis: less may be the controller's own


@dataclass(frozen=True)
class Followed:
    """What an actuator does, against our demand of its axis: a heard signal in the unit of the demand."""

    axis: str
    signal: str
    beyond: float  # signed: farther than this from the demand, somebody else demands
    above_m_s: float = 3.0  # below, the idle governor may drive the truck against our demand


@dataclass(frozen=True)
class Driveline:
    """Wheel speed against engine speed: speed = engine_speed rolling_radius / (gear_ratio final_drive)."""

    metres_per_radian: float  # rolling radius over final drive ratio
    tolerance: float  # relative
    above_m_s: float = 3.0  # of the greater of the two: below, clutches slip
    slack_m_s: float = 0.5  # a speed is up to 0.1 s old, and service brakes reach 5 m/s^2


@dataclass(frozen=True)
class Timing:
    """Times of the core, s."""

    controller_timeout: float = 0.15  # no command for so long: graded release
    stall: float = 0.1  # not requested for so long while engaged: the truck has timed out, release
    handover: float = 2.0  # after engagement, rates are scaled by handover_scale
    handover_scale: float = 0.5
    stands: float = 3.0  # standing for longer, the truck drives off only for a person (ISO 15622)
    fade_longest: float = 4.0
    assumed: float = 20.0  # longest that a hazard may be assumed unseen: 30 m/s take so long at 1.5 m/s^2
    outage: float = 2.0  # a bus that comes back later finds no braking to go on with
    persist: float = 0.5  # an implausible pair of signals, or what forbids control, for so long is a fault
    weak: float = 1.5  # torque far below our demand for so long, outside of gear changes: turbos need 1 s
    answer: float = 1.5  # after which a truck slows that is braked: 0.5 s, and `slowing`
    unexplained: float = 1.0  # somebody else's demand obeyed for so long, outside of gear changes, is a fault
    slowing: float = 1.0  # a deceleration is the mean over so long
    settle: float = 2.0  # after our last demand that slows, or engagement, brakes may still act for so long
    gear_change: float = 3.0  # what lasts longer is no gear change
    quiet: float = 1.0  # after a demand that its sender may not make, no engagement for so long
    releases: int = 4  # release frames on each axis before silence


@dataclass(frozen=True)
class Table:
    """All the core knows of one vehicle."""

    address: int  # ours
    axes: tuple[Axis, ...]
    heard: tuple[Heard, ...]
    always: tuple[int, ...]  # identifiers that may leave whenever armed: address claim, its request, DM1
    allowed: tuple[Allowed, ...]  # what transmission, brakes ... may demand of our axes; nobody else anything
    override: tuple[Override, ...]  # driver signals
    forbidden: tuple[tuple[str, float], ...]  # truck signals at a value that forbids control: parking brake
    driveline: Driveline | None
    engage_speed: tuple[float, float]
    needs_lead: bool
    obeyed: tuple[Obeyed, ...] = ()
    followed: tuple[Followed, ...] = ()
    coasts_m_s2: float = math.inf  # greatest deceleration without a demand of ours that slows
    timing: Timing = Timing()
    speed_gap_m_s: float = 2.0  # greatest difference of two wheel speeds
