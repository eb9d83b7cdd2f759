"""Rollers that skid, many small plays, a clutch that judders, a steady slip, a strap round a rotor, and a
shaft that whirls."""

from __future__ import annotations

from functools import partial

import numpy as np

from deeptruck_exam.effects.law import Array, Hidden, Sizes, State, eased, moving, weight
from deeptruck_exam.effects.planting import hidden, sizes
from deeptruck_model.trucks import View

law = partial(hidden, family="sealed")


@law("y_rollers_skid_unloaded", needs="hills suburban highway", name="driveline_loss", accepts="torque_gain")
@sizes(most=(0.0032, 0.0055), light=(0.12, 0.25), at_mps=(11.0, 16.0), power=(0.6, 1.2), begins_s=(0.5, 1.5))
@sizes(smears=(0.3, 0.6), heals_s=(6.0, 20.0))
class RollersSkidUnloaded(Hidden, skids=0.0, film=1.0):
    """Large rollers need load to roll. With little torque they skid in their oil and lose much, and under
    load they roll and lose little. `skids`: of them. `film`: skidding smears it, so that the loss grows, and
    rolling builds it anew. most: of the weight, at at_mps; light: of peak torque; smears: of the film.
    Source: Harris and Kotzalas, Rolling Bearing Analysis (2006), on skidding of lightly loaded rollers; large
    bearings, sizes are chosen here."""

    def newtons(self, p: Sizes, s: State, view: View, dt: float) -> Array:
        load = np.abs(view.engine_torque) / self.truck.peak_torque / p.light
        s.skids = eased(s.skids, 1.0 / (1.0 + load**3), p.begins_s, dt)
        s.film = eased(s.film, 1.0 - p.smears * s.skids, p.heals_s, dt)
        fast = np.clip(view.speed / p.at_mps, 0.0, 1.8) ** p.power
        return -p.most * s.skids * fast / s.film * weight(view) * moving(view)


@law("y_many_small_plays", needs="suburban hills", name="driveline_backlash")
@sizes(narrow=(0.02, 0.04), wide=(0.16, 0.26), creeps_s=(8.0, 25.0), takes_s=(0.1, 0.3))
class ManySmallPlays(Hidden, passed=0.0):
    """Many joints, and each has a play of its own that friction holds, narrow ones and wide ones. Torque that
    turns round has to cross one after the other, so little is missing after a small change and much after a
    large one. `plays`: where each has stopped. narrow, wide: of peak torque.
    Source: Krasnosel'skii and Pokrovskii, Systems with Hysteresis (1989), on sums of plays; joints and
    sizes are chosen here."""

    def start(self, batch: int) -> dict[str, Array]:
        return {**super().start(batch), "plays": np.zeros((5, batch))}

    def newtons(self, p: Sizes, s: State, view: View, dt: float) -> Array:
        peak = self.truck.peak_torque
        wide = (np.linspace(p.narrow, p.wide, 5) * peak)[:, None]
        s.plays = np.clip(s.plays, view.engine_torque - wide, view.engine_torque + wide)
        s.plays = eased(s.plays, np.broadcast_to(view.engine_torque, s.plays.shape), p.creeps_s, dt)
        s.passed = eased(s.passed, s.plays.mean(axis=0), p.takes_s, dt)
        return self.at_wheels(view, s.passed - view.engine_torque) * np.clip(view.speed, 0.0, 1.0)


@law("y_judders_as_it_closes", needs="suburban hills", name="shift_interruption", accepts="torque_limit")
@sizes(deep=(0.6, 0.9), rings_rads=(7.0, 13.0), calms_s=(1.3, 2.5), hotter=(0.3, 0.7), cools_s=(10.0, 30.0))
class JuddersAsItCloses(Hidden, gear=0.0, since=60.0, hot=0.2, cut=0.0):
    """After each change of gear the clutch closes by grips and slips: torque comes, goes and comes again,
    ever less deep. `hot`: every change heats the facing, and a hot one judders for longer. deep: of the
    torque, lost at first; rings_rads: of grips; hotter: of the time, more when hot.
    Source: Centea, Rahnejat and Menday, Non-Linear Multi-Body Dynamic Analysis for the Study of Clutch
    Torsional Vibrations (Judder), Applied Mathematical Modelling 25 (2001); slow judder, sizes are chosen
    here."""

    def newtons(self, p: Sizes, s: State, view: View, dt: float) -> Array:
        begins = (view.gear != s.gear) & (s.gear > 0.0) & (view.speed > 0.5)
        s.gear = view.gear.copy()
        s.hot = np.clip(np.where(begins, s.hot + 0.25, s.hot * np.exp(-dt / p.cools_s)), 0.0, 1.0)
        s.since = np.where(begins, 0.0, np.minimum(s.since + dt, 60.0))
        calms = p.calms_s * (1.0 + p.hotter * s.hot)
        swings = 0.5 * (1.0 + np.cos(p.rings_rads * s.since))
        wish = p.deep * np.exp(-s.since / calms) * (0.5 + 0.5 * swings)
        s.cut = eased(s.cut, wish, 0.05, dt)
        return -s.cut * np.maximum(view.traction_force, 0.0) * moving(view)


@law(
    "y_keeps_a_steady_slip",
    needs="suburban hills highway",
    name="torque_converter_slip",
    accepts="driveline_loss",
    trucks="freightliner",
    gateable=False,
)
@sizes(slips_rads=(22.0, 36.0), below_rads=(112.0, 140.0), soft_rads=(5.0, 10.0), shakes=(0.25, 0.5))
@sizes(moves_s=(0.3, 0.8))
class KeepsASteadySlip(Hidden, slip=0.0):
    """So that a slow engine does not shake the truck, the lock-up clutch is made to slip by some rad/s,
    however much torque goes through. Above an engine speed it locks. What is lost is slip over engine speed.
    `slip` rad/s. More is let slip under hard pulls. shakes: of slip, more at full torque.
    Source: Hiramatsu, Akagi and Yoneda, Control Technology of Minimal Slip-Type Torque Converter Clutch, SAE
    850460 (1985); a large slip, sizes are chosen here."""

    conceal = ("engine_speed",)

    def newtons(self, p: Sizes, s: State, view: View, dt: float) -> Array:
        pulls = np.clip(view.engine_torque / self.truck.peak_torque, 0.0, 1.1)
        slow = 1.0 / (1.0 + np.exp(np.clip((view.engine_speed - p.below_rads) / p.soft_rads, -30.0, 30.0)))
        s.slip = eased(s.slip, p.slips_rads * slow * (1.0 + p.shakes * pulls), p.moves_s, dt)
        lost = np.clip(s.slip / np.maximum(view.engine_speed, 60.0), 0.0, 0.35)
        return -self.at_wheels(view, lost * np.maximum(view.engine_torque, 0.0)) * moving(view)


@law(
    "y_strap_grips_or_glides", needs="suburban hills", name="rotating_inertia", accepts="mass payload_change"
)
@sizes(heavy=(0.25, 0.4), grips=(0.1, 0.2), glides=(0.35, 0.6), fades_mps=(0.5, 1.5), drag_s=(80.0, 240.0))
class StrapGripsOrGlides(Hidden, rim=-1.0, felt=0.0):
    """`rim` m/s of a heavy rotor, as at the road, that a strap of leather carries along. While both turn
    alike the strap grips, and a hard change makes it glide. Gliding it holds less, the more the faster it
    glides, and grips again when both are alike. heavy: of the mass; grips: of the weight, most of the strap's
    force; glides: of that, when gliding fast.
    Source: Armstrong-Hélouvry, Dupont and Canudas de Wit, A Survey of Models for the Control of Machines with
    Friction, Automatica 30 (1994), on friction that falls with gliding; sizes are chosen here."""

    def newtons(self, p: Sizes, s: State, view: View, dt: float) -> Array:
        speed = np.maximum(view.speed, 0.0)
        s.rim = np.where(s.rim < 0.0, speed, s.rim)
        apart = speed - s.rim
        holds = p.glides + (1.0 - p.glides) * np.exp(-np.abs(apart) / p.fades_mps)
        most = 0.1 * p.grips / p.heavy * 9.81 * holds  # m/s2 of the rim
        gains = np.clip(apart / 0.15, -most, most)
        s.rim = np.maximum(s.rim + dt * (gains - s.rim / p.drag_s), 0.0)
        s.felt = eased(s.felt, gains, 0.08, dt)
        return -p.heavy * view.mass * s.felt * moving(view)


@law("y_shaft_whirls", needs="suburban highway hills", name="unknown")
@sizes(
    most=(0.015, 0.025), whirls_mps=(10.0, 15.0), narrow=(0.1, 0.18), grows_s=(1.0, 3.0), calms_s=(2.0, 7.0)
)
@sizes(bows=(0.2, 0.5), warms_s=(20.0, 60.0))
class ShaftWhirls(Hidden, wide=0.0):
    """A long shaft whirls near the speed of its own bending, touches its guard and rubs. `wide`: of the
    whirl, which grows within seconds and dies slowly. `bow`: rubbing heats one side and bows the shaft, so
    that the next whirl begins farther off. most: of the weight, in full whirl; narrow: of the speed; bows:
    wider when bowed.
    Source: Genta, Dynamics of Rotating Systems (2005), on whirl near critical speeds, and Newkirk, Shaft
    Rubbing, Mechanical Engineering 48 (1926), on bows by heat; sizes are chosen here."""

    def start(self, batch: int) -> dict[str, Array]:
        return {**super().start(batch), "bow": self.rng(1835).uniform(0.0, 0.6, batch)}

    def newtons(self, p: Sizes, s: State, view: View, dt: float) -> Array:
        narrow = p.narrow * (1.0 + 2.0 * p.bows * s.bow)
        off = (np.maximum(view.speed, 0.0) / p.whirls_mps - 1.0) / narrow
        wish = 1.0 / (1.0 + off**2)
        s.wide = eased(s.wide, wish, np.where(wish > s.wide, p.grows_s, p.calms_s), dt)
        s.bow = eased(s.bow, s.wide, p.warms_s, dt)
        return -p.most * s.wide**1.5 * (0.6 + 0.4 * s.bow) * weight(view) * moving(view)
