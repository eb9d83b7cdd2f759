"""Brakes: fade, lag and dragging brakes."""

from __future__ import annotations

from collections.abc import Iterable

import numpy as np

from deeptruck_model.mismatch.mechanisms.commands import FULL_RANGE_S
from deeptruck_model.mismatch.mechanisms.courses import always, each_drive, from_moments, slowly
from deeptruck_model.mismatch.mechanisms.record import Column, Constants, Curve, Form, Mechanism, force, grid
from deeptruck_model.mismatch.mechanisms.symbols import ACTS, BRAKE, BRAKED_AGO, DISTANCE, SPEED, over
from deeptruck_model.mismatch.residual.evidence import Evidence
from deeptruck_model.mismatch.residual.expression import (
    Expression,
    Lag,
    Rerun,
    RisingLag,
    Since,
    exp,
    lift,
    maximum,
    minimum,
)

HEAT_CAPACITY = 12.5  # J/kg/K: about 500 kg of drums at 500 J/kg/K under 20 t
COOLING_S = (40.0, 120.0, 400.0, 1200.0)
LAGS, RATES = ("lag", "rise", "fall", "delay"), ("rate", "climb")


def _heat(cooling_s: float) -> Expression:
    """Temperature above the surroundings in 100 K."""
    return Lag((BRAKE * SPEED,), cooling_s, cold=True) * (cooling_s / HEAT_CAPACITY / 100.0)


def _faded(effect: Expression) -> Column:
    return Column(BRAKE * effect, 0.3, "fade", "1/K", 0.01)


def _steep(soak_s: float, half: float, steep: float) -> Column:
    """Fade that sets in about a braking power per mass `half` (W/kg), over `soak_s`."""
    hot = (over(soak_s, BRAKE * SPEED) / half) ** steep
    return Column(BRAKE * (hot / (hot + 1.0)), 0.3, "largest_loss")


def _short_of_air(refill_s: float, spare: float) -> Column:
    """Spring brakes that come on where braking over `refill_s` has used more than the `spare` air."""
    return force(-maximum(Lag((BRAKE,), refill_s, cold=True) - spare, 0.0), 1.0, "per_braking")


def _brake_rates(e: Evidence) -> Iterable[Constants]:
    """Rates for several times over the full range, in units of the brake command per s."""
    full = float(np.ptp(e["brake_command"][e.valid]))
    return grid(side=RATES, rate=[full / full_s for full_s in FULL_RANGE_S]) if full > 0 else ()


def _held(keeps_s: float) -> Expression:
    """The negative of a brake force that rises at once and releases late."""
    return RisingLag((-BRAKE,), keeps_s)


def _after_braking(decay_s: float, braking: float) -> Column:
    brakes = braking < BRAKE
    return force(-(exp(-Since((brakes,)) / decay_s) * (1.0 - brakes)), 0.15)


def _hard_braking(e: Evidence) -> Iterable[Constants]:
    threshold = max(ACTS, 0.05 * float(np.nanmax(e["brake"])))
    return grid(decay_s=(5.0, 20.0, 80.0), braking=[threshold])


BRAKE_FADE = Mechanism(
    "brake_fade",
    "brakes",
    says="the brakes lose force as they heat",
    equation="F = +F_brake (k dT + k2 dT^2);  C d(dT)/dt = F_brake v - (C/tau) dT",
    needs=("brake", "brake_command"),
    depends_on=("brake", "speed", "time since braking"),
    source="Limpert, Brake Design and Safety, ch. 4; heat balance of a drum",
    manoeuvre="repeat a stop of the same pressure cold and after a long descent",
    forms={
        "above a temperature": Form(
            lambda cooling_s, at: _faded(maximum(minimum(_heat(cooling_s), 6.0) - at, 0.0)),
            grid(cooling_s=COOLING_S, at=(0.1, 1.0, 2.5)),
            units={"cooling_s": "s"},
            fitted={"cooling_s": (10.0, 3000.0), "at": (0.1, 4.0)},
        ),
        "up to a temperature": Form(
            lambda cooling_s, at: _faded(minimum(_heat(cooling_s), at)),
            grid(cooling_s=COOLING_S, at=(0.7,)),
            units={"cooling_s": "s"},
            fitted={"cooling_s": (10.0, 3000.0), "at": (0.1, 4.0)},
        ),
        "about a power": Form(
            _steep,
            grid(soak_s=(20.0, 100.0), half=(2.0, 5.0), steep=(3.0,)),
            units={"soak_s": "s", "half": "W/kg"},
            fitted={"soak_s": (2.0, 1000.0), "half": (0.3, 20.0), "steep": (1.0, 6.0)},
        ),
        # linings that fade once, or recover late
        "over time": Form(lambda: Column(BRAKE, 0.5, "loss"), courses=(slowly(0.5),)),
        **{
            f"braking power over {s:.0f} s": Curve(
                BRAKE, over(s, BRAKE * SPEED), f"braking power over {s:.0f} s", "rising"
            )
            for s in (20.0, 60.0, 200.0, 600.0)
        },
    },
    mistaken_for="brake",
)

BRAKE_LAG = Mechanism(
    "brake_lag",
    "brakes",
    says="brake force follows its command late",
    equation="tau dF/dt = F_cmd - F, or |dF/dt| <= r",
    needs=("brake", "brake_command"),
    depends_on=("brake command rate",),
    source="air brake actuation 0.2-0.6 s, FMVSS 121 S5.3.3 and S5.3.4",
    manoeuvre="apply and release the brake in steps with the engine at idle",
    forms={
        # both ways, only applying, only releasing, or dead time: the same as a delay of the brake command
        "lag": Form(
            lambda side, tau_s: Column(
                Rerun(f"{side}_brake", tau_s), 0.3, "time_constant", "s", tau_s, mean=1.0
            ),
            grid(side=LAGS, tau_s=(0.15, 0.3, 0.6, 1.0)),
            units={"tau_s": "s"},
            words={"side": LAGS},
            fitted={"tau_s": (0.05, 2.0)},
        ),
        # air that flows in, and out, through a throttle
        "rate": Form(
            lambda side, rate: Column(Rerun(f"{side}_brake", rate), 0.3, "share_of_brake_force", mean=1.0),
            _brake_rates,
            words={"side": RATES},
        ),
    },
    mistaken_for="brake",
)

DRAGGING_BRAKE = Mechanism(
    "dragging_brake",
    "brakes",
    says="a brake keeps rubbing when it should be free",
    equation="F = -F0 (while moving), or -(F0 or k F_brake) exp(-t_since_release / tau), or -F0 exp(-x / L)",
    needs=("brake", "brake_command"),
    depends_on=("time since braking",),
    source="residual brake drag: Limpert, Brake Design and Safety",
    manoeuvre="coast down before and after braking",
    forms={
        "constant": Form(lambda: force(lift(-1.0), 0.08), courses=(always, from_moments, slowly(0.1))),
        # for a while after braking harder than `braking` (m/s^2)
        "after braking": Form(
            _after_braking, _hard_braking, units={"decay_s": "s"}, fitted={"decay_s": (2.0, 200.0)}
        ),
        "short of air": Form(
            _short_of_air,
            grid(refill_s=(20.0, 60.0), spare=(0.02, 0.1)),
            (always, each_drive()),
            units={"refill_s": "s"},
            fitted={"refill_s": (5.0, 200.0), "spare": (0.003, 0.5)},
        ),
        # a weak spring keeps the last force for a while, and presses harder than the simulator's brakes
        "kept": Form(
            lambda keeps_s: Column(_held(keeps_s), 0.1, "share_of_brake_force"),
            grid(keeps_s=(3.0, 10.0, 30.0, 100.0)),
            units={"keeps_s": "s"},
            fitted={"keeps_s": (1.0, 200.0)},
        ),
        # or only comes off late
        "late": Form(
            lambda keeps_s: Column(_held(keeps_s) + BRAKE, 0.1, "share_of_brake_force"),
            grid(keeps_s=(3.0, 10.0, 30.0, 100.0)),
            units={"keeps_s": "s"},
            fitted={"keeps_s": (1.0, 200.0)},
        ),
        # frozen, parked with, or out of adjustment until it has rubbed
        "rubs free": Form(
            lambda frees_m: force(-exp(-(DISTANCE / frees_m)), 0.1),
            grid(frees_m=(200.0, 700.0, 2000.0)),
            (always, each_drive()),
            units={"frees_m": "m"},
            fitted={"frees_m": (50.0, 5000.0)},
        ),
        "time since braking": Curve(
            (BRAKE < ACTS) * -1.0,
            BRAKED_AGO,
            "time since braking",
            "any",
            share=False,
        ),
        **{
            f"braking power over {s:.0f} s": Curve(
                lift(-1.0), over(s, BRAKE * SPEED), f"braking power over {s:.0f} s", "rising", share=False
            )
            for s in (60.0, 200.0)
        },
    },
    prior=0.7,
    mistaken_for="brake",
)

MECHANISMS = (BRAKE_FADE, BRAKE_LAG, DRAGGING_BRAKE)
