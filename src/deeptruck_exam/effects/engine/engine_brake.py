"""Engine brakes and retarders that nobody records."""

from __future__ import annotations

from functools import partial

import numpy as np

from deeptruck_exam.effects.law import Array, Hidden, Sizes, State, eased, moving
from deeptruck_exam.effects.planting import hidden, sizes
from deeptruck_exam.effects.series import some_drives
from deeptruck_model.trucks import View

law = partial(hidden, name="engine_brake", accepts="engine_friction")

ENGINE_BRAKE_RPM = np.array([900.0, 1200.0, 1500.0, 1800.0, 2100.0])
ENGINE_BRAKE = np.array([0.22, 0.40, 0.58, 0.80, 1.0])


@law("engine_brake", "first", "descent hills suburban")
@sizes(torque_nm=(250.0, 800.0), exponent=(1.4, 2.1), delay_s=(0.3, 0.6), from_mps=(7.0, 12.0))
class SilentRetarder(Hidden, closed=0.0, torque=0.0):
    """A retarder switched by the driver, whose switch nobody records.
    Source: Compression release brake: torque that grows with engine speed, switched in stages of cylinders
    (Jacobs; see Heywood, Internal Combustion Engine Fundamentals, for the pumping work); exponent and delays
    are chosen here."""

    def newtons(self, p: Sizes, s: State, view: View, dt: float) -> Array:
        closed = (view.u[:, 0] <= 0.01 * abs(self.truck.full_command)) & (view.speed > p.from_mps)
        s.closed = np.where(closed & (view.shifting == 0.0), s.closed + dt, 0.0)
        stages = np.clip(np.floor((s.closed - p.delay_s) / 0.4 + 1.0), 0.0, 3.0) / 3.0
        wanted = stages * p.torque_nm * np.clip(view.engine_speed / 180.0, 0.0, 1.3) ** p.exponent
        s.torque += dt * (wanted - s.torque) / 0.08
        return -self.at_wheels(view, s.torque) * moving(view)


@law("exhaust_flap", "second", "descent suburban")
@sizes(torque_nm=(280.0, 650.0), fill=(0.6, 1.8), cut_out_rpm=(850.0, 1000.0), limit=(0.7, 1.0))
class ExhaustFlap(Hidden, shut=0.0, pressure=0.0):
    """Closed by the first touch of the brake pedal, opened by the throttle, and never recorded. fill:
    manifold fillings a second at 1500 rpm.
    Source: Exhaust brake: pumping work against a throttled exhaust (Heywood, Internal Combustion Engine
    Fundamentals, ch. 13, on pumping), back pressure limited by the valve springs; the latch on the brake
    pedal and the numbers are chosen here."""

    def newtons(self, p: Sizes, s: State, view: View, dt: float) -> Array:
        throttle = view.u[:, 0] > 0.01 * abs(self.truck.full_command)
        fast = view.engine_speed * 30.0 / np.pi > p.cut_out_rpm
        s.shut = np.where(throttle | ~fast, 0.0, np.where(view.u[:, 1] > 0.02, 1.0, s.shut))
        flow = p.fill * view.engine_speed / 157.0
        s.pressure += dt * np.where(s.shut > 0.0, flow * (1.2 - s.pressure), -6.0 * s.pressure)
        back = np.minimum(s.pressure, p.limit)
        return -self.at_wheels(view, p.torque_nm * back) * moving(view)


@law("engine_brake_with_pedal", "fourth", "descent suburban hills")
@sizes(torque_nm=(450.0, 1100.0), after_s=(0.3, 0.9), stays_s=(1.0, 4.0))
class EngineBrakeWithPedal(Hidden, pressed=0.0, left=0.0, torque=0.0):
    """torque_nm: at 2100 rpm. The least touch of the pedal has all of it.
    Source: Engine-brake mode 'with service brake' of heavy diesels (owner's manuals, Detroit and Cummins
    electronic features): the compression brake comes in with the brake pedal and stays a moment after it;
    retarding torque over speed as in suppliers' tables; times and sizes chosen here."""

    def newtons(self, p: Sizes, s: State, view: View, dt: float) -> Array:
        s.pressed = np.where(view.u[:, 1] > 0.02, s.pressed + dt, 0.0)
        s.left = np.where(s.pressed > p.after_s, p.stays_s, np.maximum(s.left - dt, 0.0))
        s.left = np.where(view.u[:, 0] > 0.01 * abs(self.truck.full_command), 0.0, s.left)
        rpm = view.engine_speed * 30.0 / np.pi
        able = np.interp(rpm, ENGINE_BRAKE_RPM, ENGINE_BRAKE) * (rpm > 950.0)
        s.torque += dt * (p.torque_nm * able * (s.left > 0.0) - s.torque) / 0.15
        return -self.at_wheels(view, s.torque) * moving(view)


@law("regulated_exhaust_brake", "fourth", "descent hills")
@sizes(torque_nm=(240.0, 520.0), knee_rpm=(1200.0, 1700.0), share_of_drives=(0.5, 0.8))
class RegulatedExhaustBrake(Hidden, shut=0.0):
    """The switch is moved once in some drives, and nobody records it.
    Source: Exhaust brakes whose back-pressure valve holds the manifold at a set pressure (data sheets of
    constant-pressure exhaust brakes): torque with engine speed squared up to a knee, constant above; a dash
    switch that is on in some drives; sizes are chosen here."""

    def prepare(self) -> None:
        rng, batch = self.rng(312), self.setting.batch
        drives = some_drives(rng, batch, self.p.share_of_drives)
        moved = np.where(rng.random(batch) < 0.4, rng.uniform(0.1, 0.5, batch), 0.0)
        self.from_s = np.where(drives, moved * self.setting.duration_s, np.inf)

    def newtons(self, p: Sizes, s: State, view: View, dt: float) -> Array:
        rpm = view.engine_speed * 30.0 / np.pi
        closed = (view.u[:, 0] <= 0.01 * abs(self.truck.full_command)) & (rpm > 900.0)
        wanted = closed & (view.time >= self.from_s)
        s.shut += dt * (wanted - s.shut) / np.where(wanted, 0.5, 0.1)
        torque = p.torque_nm * np.minimum((rpm / p.knee_rpm) ** 2, 1.0) * s.shut
        return -self.at_wheels(view, torque) * moving(view)


@law("stages_by_acceleration", "fifth", "descent hills")
@sizes(torque_nm=(500.0, 1100.0), moves_s=(0.8, 2.5), unboosted=(0.4, 0.65), boost_s=(0.8, 2.5))
class StagesByAcceleration(Hidden, stage=0.0, waits=0.0, boost=0.0, torque=0.0):
    """The lever is not recorded. The first stage comes with the first gain in speed. torque_nm: with all
    stages, boosted, at 190 rad/s.
    Source: Drivers' use of a six-stage lever, as fleets' event recorders show it: one stage more whenever the
    truck gains speed on a closed pedal, one less when it loses; compression brakes grow with the boost they
    make themselves (Cummins, SAE 650196 and later papers on retarders); sizes chosen here."""

    def newtons(self, p: Sizes, s: State, view: View, dt: float) -> Array:
        closed = (view.u[:, 0] <= 0.01 * self.truck.full_command) & (view.speed > 4.0)
        s.waits = np.where(closed, s.waits + dt, 0.0)
        step = np.where(view.acceleration > 0.04, 1.0, np.where(view.acceleration < -0.45, -1.0, 0.0))
        moves = closed & (s.waits > p.moves_s) & (step != 0.0)
        s.stage = np.where(closed, np.clip(s.stage + moves * step, 0.0, 6.0), 0.0)
        s.waits = np.where(moves, 0.0, s.waits)
        turns = np.clip(view.engine_speed / 190.0, 0.0, 1.3)
        share = s.stage / 6.0
        s.boost += dt * (share * turns - s.boost) / p.boost_s
        wanted = p.torque_nm * share * turns * (p.unboosted + (1.0 - p.unboosted) * s.boost)
        s.torque += dt * (wanted - s.torque) / np.where(wanted > s.torque, 0.18, 0.1)
        return -self.at_wheels(view, s.torque) * moving(view)


@law("retarder_sheds_heat", "fifth", "descent hills")
@sizes(most_nm=(450.0, 1000.0), square_at=(95.0, 150.0), fill_s=(0.4, 1.2), hot_j=(2.5e6, 7.0e6))
@sizes(leaves=(0.35, 0.6))
class RetarderShedsHeat(Hidden, set=0.0, filled=0.0, heat=0.0):
    """Braking by the pedal fills it, the accelerator empties it; a hot one keeps `leaves` of its torque.
    square_at: rad/s at which the limit is reached.
    Source: Hydrodynamic retarders on the engine's side of the gearbox (Automotive Handbook, Bosch, on primary
    retarders): torque with speed squared up to the valve's limit, half a second of filling, and taken back by
    the coolant's temperature; set by the driver for a hill; sizes chosen here."""

    def newtons(self, p: Sizes, s: State, view: View, dt: float) -> Array:
        pressed = view.u[:, 1] > 0.03 * (1.0 if self.truck.by_deceleration else 100.0)
        opened = view.u[:, 0] > 0.02 * self.truck.full_command
        s.set = np.where(opened | (view.speed < 3.0), 0.0, np.where(pressed, 1.0, s.set))
        s.filled += dt * (s.set - s.filled) / np.where(s.set > s.filled, p.fill_s, 0.3)
        cut = 1.0 - (1.0 - p.leaves) * np.clip((s.heat - 0.5) / 0.4, 0.0, 1.0)
        torque = p.most_nm * cut * s.filled * np.minimum((view.engine_speed / p.square_at) ** 2, 1.0)
        s.heat += dt * (torque * view.engine_speed / p.hot_j - s.heat / 90.0)
        return -self.at_wheels(view, torque) * moving(view)


@law("stalk_set_by_eye", "sixth", "descent hills")
@sizes(torque_nm=(500.0, 1050.0), power=(1.3, 2.1), from_slope=(0.004, 0.014), steeper=(0.009, 0.016))
@sizes(again_s=(5.0, 14.0))
class StalkSetByEye(Hidden, stage=0.0, waits=0.0, torque=0.0):
    """Three stages; on the flat and uphill none, however long the pedal is closed. torque_nm: of all stages,
    at 190 rad/s; steeper: for each stage more.
    Source: Drivers set the stalk of an engine brake by the hill in sight when they lift, and think again
    later (AAMVA Commercial Driver License Manual, on mountain driving and retarders); torque with a power of
    engine speed as suppliers' curves of bleeder brakes show; stages and sizes are chosen here."""

    def newtons(self, p: Sizes, s: State, view: View, dt: float) -> Array:
        closed = (view.u[:, 0] <= 0.01 * self.truck.full_command) & (view.speed > 4.0)
        s.waits = np.where(closed, s.waits - dt, 0.6)
        looks = closed & (s.waits <= 0.0)
        stage = np.clip(np.ceil((-view.grade - p.from_slope) / p.steeper), 0.0, 3.0)
        s.stage = np.where(closed, np.where(looks, stage, s.stage), 0.0)
        s.waits = np.where(looks, p.again_s, s.waits)
        turns = np.clip(view.engine_speed / 190.0, 0.0, 1.3)
        wanted = p.torque_nm * s.stage / 3.0 * turns**p.power
        s.torque += dt * (wanted - s.torque) / 0.25
        return -self.at_wheels(view, s.torque) * moving(view)


@law("compression_brake_fills_itself", "seventh", "descent hills")
@sizes(bare_nm=(170.0, 380.0), gain=(0.8, 1.8), fills_s=(1.5, 5.0), from_rads=(85.0, 105.0))
class CompressionBrakeFillsItself(Hidden, on=0.0, boost=0.0):
    """Every change of gear empties the manifold again.
    Source: Compression release brakes (C. L. Cummins, US patent 3 220 392, 1965) on the bench, and UN
    Regulation No. 13, annex 4, type IIA: it compresses what the turbocharger delivers, which follows the
    braking; a tap on the brakes switches it on, the pedal off."""

    def newtons(self, p: Sizes, s: State, view: View, dt: float) -> Array:
        closed = view.u[:, 0] <= 0.01 * self.truck.full_command
        s.on = np.where(closed & (view.brake_force > 0.0), 1.0, np.where(closed, s.on, 0.0))
        works = s.on * (view.engine_speed > p.from_rads) * (1.0 - view.shifting)
        turns = np.clip(view.engine_speed / 190.0, 0.0, 1.3)
        fills = np.where(works > 0.0, (turns**2 - s.boost) / p.fills_s, -s.boost / 0.3)
        s.boost += dt * fills
        torque = p.bare_nm * turns * (1.0 + p.gain * s.boost) * works
        return -self.at_wheels(view, torque) * moving(view)


@law("s_vanes_brake", "eighth", "descent hills")
@sizes(power_w=(50e3, 130e3), most_nm=(450.0, 900.0), closes_s=(1.0, 4.0), from_rads=(90.0, 115.0))
class VanesBrake(Hidden, shut=0.0):
    """It regulates power, so that a lower gear does not brake more.
    Source: Turbocharger vanes that close for engine braking hold a set back power (Schmitz, Jochheim, Karch
    and Nagel, MTZ 55, 1994, on turbo brakes); control and sizes are chosen here."""

    def newtons(self, p: Sizes, s: State, view: View, dt: float) -> Array:
        closed = (self.pedal(view) < 0.01) & (view.engine_speed > p.from_rads) & (view.speed > 3.0)
        s.shut = s.shut + dt * (closed - s.shut) / np.where(closed, p.closes_s, 0.2)
        torque = np.minimum(p.power_w / np.maximum(view.engine_speed, 60.0), p.most_nm)
        return -self.at_wheels(view, s.shut * torque) * moving(view)


@law("e_foam_in_the_slave_pistons", "eleventh", "descent hills")
@sizes(share=(0.45, 0.8), waits_s=(0.4, 1.5), foams_s=(10.0, 30.0), left=(0.3, 0.6), from_rads=(100.0, 118.0))
class FoamInTheSlavePistons(Hidden, shut=0.0, on=0.0, foam=0.0):
    """A switch that was left on: the engine brake follows the pedal. Its oil takes up air the faster the
    engine turns, and lifts the valves less and less until it has rested. share: of its torque at 200 rad/s;
    left: of that, all foam.
    Source: Nikolajsen, Viscosity and Density Models for Aerated Oil in Fluid-Film Bearings, Tribology Trans.
    42 (1999), on air in oil, and Cummins, US patent 3 220 392 (1965), on slave pistons moved by oil; times
    are chosen here."""

    def newtons(self, p: Sizes, s: State, view: View, dt: float) -> Array:
        turns = view.engine_speed
        s.shut = np.where(self.pedal(view) < 0.02, s.shut + dt, 0.0)
        wants = (s.shut > p.waits_s) * np.clip((turns - p.from_rads) / 8.0, 0.0, 1.0)
        s.on = s.on + dt * (wants - s.on) / np.where(wants > s.on, 0.4, 0.15)
        gains = s.on * (turns / 160.0) ** 2 * (1.0 - s.foam) / p.foams_s
        s.foam = np.clip(s.foam + dt * (gains - (1.0 - s.on) * s.foam / 40.0), 0.0, 1.0)
        lifts = 1.0 - (1.0 - p.left) * s.foam
        torque = p.share * self.truck.engine_brake_torque * np.clip(turns / 200.0, 0.0, 1.2) * lifts
        return -self.at_wheels(view, torque * s.on) * moving(view)


@law("x_brakes_with_hot_gas", "thirteenth", "descent hills suburban")
@sizes(share=(0.6, 0.95), cools_s=(15.0, 45.0), heats_s=(8.0, 25.0), left=(0.2, 0.4), waits_s=(0.4, 1.2))
@sizes(fills_s=(0.4, 1.0))
class BrakesWithHotGas(Hidden, shut=0.0, on=0.0, heat=0.5):
    """A switch that was left on: when the pedal is up the engine brakes, by gas that its turbine holds back.
    Behind a climb hot gas and a fast turbine brake strongly; without fuel both cool, and the brake fades away
    while nobody touches anything. share: of the engine brake's torque; left: of it, all cold.
    Source: Hu, Israel and Vorih, Variable Valve Actuation and Diesel Engine Retarding Performance, SAE
    970343, and Heisler, Advanced Engine Technology (1995), on exhaust manifold pressure in retarding; sizes
    are chosen here."""

    def newtons(self, p: Sizes, s: State, view: View, dt: float) -> Array:
        power = np.clip(1.6 * self.power_share(view), 0.0, 1.0)
        s.heat = s.heat + dt * (power - s.heat) / np.where(power > s.heat, p.heats_s, p.cools_s)
        s.shut = np.where(self.pedal(view) < 0.02, s.shut + dt, 0.0)
        wants = (s.shut > p.waits_s) * np.clip((view.engine_speed - 85.0) / 15.0, 0.0, 1.0)
        s.on = s.on + dt * (wants - s.on) / np.where(wants > s.on, p.fills_s, 0.15)
        turns = np.clip(view.engine_speed / 190.0, 0.0, 1.3) ** 1.4
        torque = p.share * self.truck.engine_brake_torque * turns * (p.left + (1.0 - p.left) * s.heat)
        return -self.at_wheels(view, s.on * torque) * np.clip(view.speed / 3.0, 0.0, 1.0)


@law("q_brake_oil_drains_late", "fifteenth", "descent hills suburban")
@sizes(nm=(240.0, 430.0), fills_s=(0.2, 0.5), drains_s=(0.6, 1.4), cold=(1.0, 2.5), warms_s=(80.0, 240.0))
class BrakeOilDrainsLate(Hidden, oil=0.0, warm=0.0):
    """`oil` in the housings of a compression brake that comes in whenever the pedal is up. When the driver
    pulls again it has to drain first, and some cylinders brake on for a moment, longer while it is cold. nm:
    at 190 rad/s; cold: of drains_s, more.
    Source: Jacobs Vehicle Systems, engine brake service manuals, on solenoids that let oil in and out and on
    slow release with cold oil; a worn valve, sizes are chosen here."""

    def newtons(self, p: Sizes, s: State, view: View, dt: float) -> Array:
        s.warm = eased(s.warm, 1.0, p.warms_s / (0.3 + np.clip(self.power_share(view), 0.0, 1.0)), dt)
        on = (self.pedal(view) < 0.02) & (view.engine_speed > 85.0) & (view.speed > 3.0)
        drains = p.drains_s * (1.0 + p.cold * (1.0 - s.warm))
        s.oil = eased(s.oil, np.where(on, 1.0, 0.0), np.where(on, p.fills_s, drains), dt)
        torque = p.nm * s.oil * np.clip(view.engine_speed / 190.0, 0.2, 1.3) ** 1.4
        return -self.at_wheels(view, torque) * np.clip(view.speed / 3.0, 0.0, 1.0)


@law("b_each_tap_adds_a_stage", "twentieth", "descent hills suburban")
@sizes(stage_nm=(200.0, 330.0), at_rads=(150.0, 190.0), bites_s=(0.2, 0.6), taps=(0.012, 0.03))
class EachTapAddsAStage(Hidden, stages=0.0, was=0.0, torque=0.0):
    """Each tap of the brake pedal switches on one more of three stages of an engine brake that nobody
    records, and they stay on when the foot is off again. The accelerator switches all of them off. stage_nm:
    of torque, at at_rads; taps: of full braking, that counts as a tap.
    Source: SAE J1939-71 on engine brakes that latch, and makers' manuals on stages by taps of the brake
    pedal; sizes are chosen here."""

    def newtons(self, p: Sizes, s: State, view: View, dt: float) -> Array:
        asked = view.brake_force / self.truck.brake_capacity
        pressed = np.where(asked > p.taps, 1.0, np.where(asked < 0.5 * p.taps, 0.0, s.was))
        s.stages = np.minimum(s.stages + np.maximum(pressed - s.was, 0.0), 3.0)
        s.stages = np.where(self.pedal(view) > 0.05, 0.0, s.stages)
        s.was = pressed
        turns = np.clip(view.engine_speed / p.at_rads, 0.0, 1.3)
        s.torque = eased(s.torque, p.stage_nm * s.stages * turns**1.5, p.bites_s, dt)
        return -self.at_wheels(view, s.torque) * np.clip(view.speed / 3.0, 0.0, 1.0)
