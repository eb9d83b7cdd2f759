"""Second drives: electric, hydraulic, on a trailer or from a wire. The tool has no name for them."""

from __future__ import annotations

from functools import partial

import numpy as np

from deeptruck_exam.effects.law import GRAVITY, Array, Hidden, Sizes, State, eased, moving, weight
from deeptruck_exam.effects.places import OnRoad, smooth_stretches
from deeptruck_exam.effects.planting import hidden, sizes
from deeptruck_model.trucks import View

law = partial(hidden, name="unknown")


@law("hybrid_axle", "first", "suburban hills", trucks="trucksim volvo")
@sizes(power_w=(60000.0, 130000.0), force_n=(3500.0, 8000.0), energy_j=(0.8e6, 2.5e6))
class TrailerAxle(Hidden, charge=0.5, force=0.0):
    """Source: Electric trailer axle: helps while the driver asks for much, harvests in coasting, until its
    battery is empty or full; control law chosen here."""

    def newtons(self, p: Sizes, s: State, view: View, dt: float) -> Array:
        share = np.clip(view.engine_torque / self.truck.peak_torque, 0.0, 1.0)
        most = np.minimum(p.force_n, p.power_w / np.maximum(view.speed, 1.0))
        helping = most * np.clip((share - 0.45) / 0.2, 0.0, 1.0) * (s.charge > 0.02)
        coasting = (view.u[:, 0] <= 0.01 * self.truck.full_command) & (view.speed > 4.0) & (s.charge < 0.98)
        wanted = np.where(coasting, -0.35 * most, helping)
        s.force += dt * (wanted - s.force) / 0.25
        s.charge = np.clip(s.charge - dt * s.force * view.speed / p.energy_j, 0.0, 1.0)
        return s.force * moving(view)


@law("trolley_wire", "second", "highway hills")
@sizes(power_w=(40000.0, 120000.0), force_n=(2500.0, 6000.0), raise_s=(1.0, 3.0), gap_m=(300.0, 900.0))
class TrolleyWire(OnRoad, raised=0.0, force=0.0):
    """Helps from a quarter of full torque on, under the wire alone.
    Source: Electric road with overhead wire: traction motors help under the wire, limited in power (BMDV
    field trials ELISA and FESH, Germany, 2019-2024); control law and stretches are chosen here."""

    def prepare(self) -> None:
        gap = self.p.gap_m
        road = smooth_stretches(self.rng(161), self.rows(), (0.5 * gap, 1.5 * gap), (500.0, 1500.0))
        self.road = (road > 0.02).astype(float)

    def newtons(self, p: Sizes, s: State, view: View, dt: float) -> Array:
        under = (self.read(self.road, view) > 0.0) & (view.speed > 5.0)
        s.raised = np.where(under, np.minimum(s.raised + dt, p.raise_s + 1.0), 0.0)
        most = np.minimum(p.force_n, p.power_w / np.maximum(view.speed, 1.0))
        asked = np.clip((view.engine_torque / self.truck.peak_torque - 0.25) / 0.4, 0.0, 1.0)
        s.force += dt * (most * asked * (s.raised > p.raise_s) - s.force) / 0.4
        return s.force * moving(view)


@law("hydraulic_launch_assist", "fourth", "suburban")
@sizes(most=(0.025, 0.055), volume_j=(0.25e6, 0.8e6), gas=(0.35, 0.6), until_mps=(9.0, 13.0))
class HydraulicLaunchAssist(Hidden):
    """most: over weight, at full pressure; volume_j: what a full accumulator holds, for a 20 t truck.
    Source: Hydraulic launch assist of refuse trucks (Eaton; US EPA series and parallel hydraulic hybrids,
    EPA-420-F-06-043): a pump-motor on the propeller shaft charges an accumulator with the brake pedal and
    empties it on the next start; gas pressure as a polytrope; sizes are chosen here."""

    def start(self, batch: int) -> dict[str, Array]:
        return {"oil": self.rng(380).uniform(0.0, 0.6, batch), "force": np.zeros(batch)}

    def newtons(self, p: Sizes, s: State, view: View, dt: float) -> Array:
        truck = self.truck
        pressure = (p.gas / (1.0 - (1.0 - p.gas) * s.oil)) ** 1.4
        able = p.most * weight(view) * pressure
        slow = np.clip((p.until_mps - view.speed) / 1.5, 0.0, 1.0)
        asked = np.clip(view.u[:, 0] / (0.3 * truck.full_command), 0.0, 1.0)
        gives = able * asked * slow * np.clip(s.oil / 0.05, 0.0, 1.0)
        takes = able * (view.u[:, 1] > 0.02) * np.clip((1.0 - s.oil) / 0.05, 0.0, 1.0)
        s.force += dt * (np.where(view.u[:, 1] > 0.02, -takes, gives) - s.force) / 0.2
        holds = p.volume_j * view.mass / 2.0e4
        s.oil = np.clip(s.oil - dt * s.force * np.maximum(view.speed, 0.0) / holds, 0.0, 1.0)
        return s.force * moving(view)


@law("hydrostatic_front_axle", "fourth", "suburban")
@sizes(most=(0.022, 0.045), full_mps=(3.0, 5.5), off_mps=(7.5, 11.0), again_mps=(2.0, 4.0))
class HydrostaticFrontAxle(Hidden, on=1.0, force=0.0):
    """most: over weight. Works with the throttle open alone.
    Source: Hydraulic wheel motors in the front hubs (product papers of on-demand front drives for trucks):
    they pull with a pressure-limited force at walking pace and with what the pump delivers above, let go at a
    road speed and stay off until the truck has slowed well below; sizes are chosen here."""

    def newtons(self, p: Sizes, s: State, view: View, dt: float) -> Array:
        again = view.speed < p.off_mps - p.again_mps
        s.on = np.where(view.speed > p.off_mps, 0.0, np.where(again, 1.0, s.on))
        open_throttle = np.clip(view.u[:, 0] / (0.15 * self.truck.full_command) - 0.3, 0.0, 1.0)
        pump = np.minimum(p.full_mps / np.maximum(view.speed, 0.1), 1.0)
        wanted = p.most * weight(view) * pump * s.on * open_throttle
        s.force += dt * (wanted - s.force) / 0.35
        return s.force * moving(view)


@law("generator_on_the_trailer_axle", "fifth", "suburban highway hills")
@sizes(power_w=(14000.0, 34000.0), most=(0.012, 0.022), on_mps=(2.0, 5.0), cools_s=(20.0, 60.0))
@sizes(warms_s=(15.0, 50.0))
class GeneratorOnTheTrailerAxle(Hidden):
    """most: of the weight.
    Source: Axle generators that feed a refrigerated trailer (product papers of recuperating trailer axles and
    of hub generators): a constant power, so that the drag is the larger the slower the truck, up to a limit;
    on and off with the box's thermostat; sizes are chosen here."""

    def prepare(self) -> None:
        self.first = self.rng(482).uniform(0.1, 0.9, self.setting.batch)

    def start(self, batch: int) -> dict[str, Array]:
        return {"box": self.first.copy(), "on": (self.first > 0.5).astype(float), "force": np.zeros(batch)}

    def newtons(self, p: Sizes, s: State, view: View, dt: float) -> Array:
        s.on = np.where(s.box > 1.0, 1.0, np.where(s.box < 0.0, 0.0, s.on))
        turns = view.speed > p.on_mps
        s.box = s.box + dt * np.where(turns & (s.on > 0.0), -1.0 / p.cools_s, 1.0 / p.warms_s)
        s.box = np.clip(s.box, -0.05, 1.05)
        drag = np.minimum(p.power_w / np.maximum(view.speed, 1.0), p.most * weight(view))
        s.force += dt * (drag * s.on * turns - s.force) / 0.5
        return -s.force * moving(view)


@law("hole_in_the_blending", "fifth", "suburban")
@sizes(depth=(0.5, 0.8), at_mps=(3.0, 6.5), lasts_s=(0.6, 1.5), touch=(0.3, 0.7))
class HoleInTheBlending(Hidden, hole=0.0, size=0.0, was=0.0, speed=0.0):
    """Once in each application at the first touch, and once at the speed of the handover.
    Source: Blending of electric and friction brakes: where the motors hand over, as the truck slows and at
    the first touch, the pads still have to cross their clearance (von Albrichsfeld and Karner, Brake System
    for Hybrid and Electric Vehicles, SAE 2009-01-1217): a hole of less than a second; sizes chosen here."""

    def newtons(self, p: Sizes, s: State, view: View, dt: float) -> Array:
        braked = (view.brake_force > 0.01 * weight(view)).astype(float)
        hands_over = (s.speed >= p.at_mps) & (view.speed < p.at_mps) & (braked > 0.0)
        touched = (braked > s.was) & (view.speed > p.at_mps)
        s.size = np.where(hands_over, 1.0, np.where(touched, p.touch, s.size))
        s.hole = np.where(hands_over | touched, p.lasts_s, np.maximum(s.hole - dt, 0.0))
        s.was, s.speed = braked, view.speed.copy()
        shape = np.sin(0.5 * np.pi * np.clip(s.hole / p.lasts_s, 0.0, 1.0))
        return p.depth * s.size * shape * view.brake_force * moving(view)


@law("dolly_pushes_uphill", "sixth", "hills")
@sizes(share=(0.25, 0.5), from_slope=(0.004, 0.010), power_w=(70e3, 160e3), energy_j=(2.5e6, 8.0e6))
@sizes(late_s=(1.0, 3.0))
class DollyPushesUphill(Hidden, slope=0.0, charge=0.7, tired=0.0):
    """Whatever the pedals do: it knows the slope alone, a little late.
    Source: Converter dollies with electric drives for road trains (research on long combination vehicles at
    Chalmers and VTI): they push by their own inclinometer, with a share of the slope's weight up to a power,
    until the battery has had enough; downhill it fills; sizes are chosen here."""

    def newtons(self, p: Sizes, s: State, view: View, dt: float) -> Array:
        s.slope += dt * (view.grade - s.slope) / p.late_s
        speed = np.maximum(view.speed, 2.0)
        s.tired = np.where(s.charge <= 0.0, 1.0, np.where(s.charge > 0.25, 0.0, s.tired))
        wanted = p.share * np.maximum(s.slope - p.from_slope, 0.0) * view.mass * GRAVITY
        force = np.minimum(wanted, p.power_w / speed) * (1.0 - s.tired) * np.clip(view.speed - 1.0, 0.0, 1.0)
        fills = 30e3 + 0.5 * p.power_w * (s.slope < -0.01)
        s.charge = np.clip(s.charge + dt * (fills * (force <= 0.0) - force * speed) / p.energy_j, 0.0, 1.0)
        return force


@law("filled_gaps_are_paid_back", "seventh", "suburban hills")
@sizes(fills=(0.5, 1.1), lasts_s=(1.0, 2.6), most_w=(60e3, 140e3), back_w=(10e3, 28e3))
class FilledGapsArePaidBack(Hidden, pull=0.0, left=0.0, owes=0.0, gives=0.0):
    """`owes` J to the capacitors; `pull` N that was there before the change.
    Source: Torque filling by an electric axle in hybrid trucks (Guzzella and Sciarretta, Vehicle Propulsion
    Systems, 2013, on parallel hybrids): what a change of gear leaves out is given by capacitors, and taken
    back afterwards at a steady power."""

    def newtons(self, p: Sizes, s: State, view: View, dt: float) -> Array:
        shifts, speed = view.shifting > 0.0, np.maximum(view.speed, 1.0)
        pull = np.maximum(view.traction_force, 0.0)
        s.pull = np.where(shifts, s.pull, s.pull + dt * (pull - s.pull) / 0.15)
        s.left = np.where(shifts, p.lasts_s, np.maximum(s.left - dt, 0.0))
        fades = np.clip(s.left / p.lasts_s, 0.0, 1.0)
        wanted = np.minimum(p.fills * s.pull * fades, p.most_w / speed) * (view.brake_force <= 0.0)
        s.gives = s.gives + dt * (wanted * (s.left > 0.0) - s.gives) / 0.12
        takes = np.minimum(p.back_w / np.maximum(speed, 5.0), 0.03 * weight(view))
        takes = takes * ((s.left <= 0.0) & (s.owes > 0.0))
        s.owes = np.maximum(s.owes + dt * speed * (s.gives - takes), 0.0)
        return (s.gives - takes) * np.clip(view.speed - 1.0, 0.0, 1.0)


@law("generates_unasked", "seventh", "highway hills")
@sizes(power_wpkg=(1.2, 3.0), from_mps=(13.5, 19), until=(0.62, 0.85))
class GeneratesUnasked(Hidden, on=0.0, current=0.0, charge=0.0):
    """Less force at more speed, once it has begun.
    Source: Jahns, Caliskan, Uncontrolled Generator Operation of Interior PM Synchronous Machines Following
    High-Speed Inverter Shutdown, IEEE Trans. Ind. Appl. 35 (1999): a machine brakes once its voltage is above
    the battery's, which charging raises, and goes on far below that speed."""

    def newtons(self, p: Sizes, s: State, view: View, dt: float) -> Array:
        begins = p.from_mps * (1.0 + 0.1 * np.minimum(s.charge, 1.0))
        over = view.speed > begins
        s.on = np.where(over, 1.0, np.where(view.speed < p.until * begins, 0.0, s.on))
        s.current += dt * (s.on - s.current) / 0.3
        power = p.power_wpkg * view.mass * s.current
        s.charge += dt * power / view.mass / 150.0 - dt * s.charge / 120.0
        return -power / np.maximum(view.speed, 5.0) * moving(view)


@law("w_zone_without_engine", "twelfth", "suburban hills highway")
@sizes(least=(0.2, 0.4), back=(0.012, 0.028), frees=(0.6, 1.0), apart_m=(300.0, 900.0), changes_s=(0.6, 2.0))
class ZoneWithoutEngine(OnRoad, runs=0.0):
    """In zones that a map holds, a smaller motor drives and the engine stands. It gives less than was asked,
    turns no engine when coasting, and takes energy back once the pedal is up. least: of peak torque; back: of
    the weight; frees: of the engine's drag.
    Source: Soldo, Skugor and Deur, Synthesis of Optimal Battery State-of-Charge Trajectory for Blended
    Regime of Plug-in Hybrid Electric Vehicles in the Presence of Low-Emission Zones and Varying Road Grades,
    Energies 12 (2019); zones and sizes are chosen here."""

    def prepare(self) -> None:
        gaps = (0.5 * self.p.apart_m, 1.5 * self.p.apart_m)
        zones = smooth_stretches(self.rng(1124), self.rows(), gaps, (250.0, 800.0))
        self.road = np.where(zones > 0.25, 1.0, 0.0)

    def newtons(self, p: Sizes, s: State, view: View, dt: float) -> Array:
        s.runs = s.runs + dt * (self.read(self.road, view) - s.runs) / p.changes_s
        asked = np.maximum(view.engine_torque, 0.0)
        lacks = np.maximum(asked - p.least * self.truck.peak_torque, 0.0)
        drag = p.frees * np.maximum(-view.engine_torque, 0.0)
        up = np.clip(1.0 - self.pedal(view) / 0.03, 0.0, 1.0) * np.clip((view.speed - 2.0) / 3.0, 0.0, 1.0)
        back = p.back * weight(view) * up * np.minimum(1.0, 12.0 / np.maximum(view.speed, 1.0))
        return (self.at_wheels(view, drag - lacks) - back) * s.runs * moving(view)


@law("x_magnets_turn_along", "thirteenth", "suburban hills highway descent")
@sizes(
    drags=(0.010, 0.019), peak_mps=(7.0, 13.0), out_mps=(14.0, 18.0), back=(0.65, 0.8), warms_s=(60.0, 200.0)
)
@sizes(weakens=(0.3, 0.5), moves_s=(0.3, 1.0))
class MagnetsTurnAlong(Hidden, joined=1.0, clutch=1.0, warm=0.0):
    """A helper axle with magnets in its motor is not switched on, but it turns along and its iron drags. A
    clutch parts it above a speed, and joins it again only well below; while parted it cools, and warm magnets
    drag less. drags: of the weight; back: of out_mps; weakens: of the drag, all warm.
    Source: Mi, Slemon and Bonert, Modeling of Iron Losses of Permanent-Magnet Synchronous Motors, IEEE Trans.
    Industry Applications 39 (2003): hysteresis and eddy parts over speed; sizes are chosen here."""

    def newtons(self, p: Sizes, s: State, view: View, dt: float) -> Array:
        fast, slow = view.speed > p.out_mps, view.speed < p.back * p.out_mps
        s.joined = np.where(fast, 0.0, np.where(slow, 1.0, s.joined))
        s.clutch = s.clutch + dt * (s.joined - s.clutch) / p.moves_s
        ratio = np.maximum(view.speed, 0.0) / p.peak_mps
        iron = 0.4 + 0.6 * np.minimum(ratio, 1.8)
        s.warm = np.clip(s.warm + dt * (s.clutch * iron - s.warm) / p.warms_s, 0.0, 1.2)
        drag = p.drags * iron * (1.0 - p.weakens * s.warm) * s.clutch
        return -drag * weight(view) * moving(view)


@law("k_trailer_carries_itself", "fourteenth", "suburban hills")
@sizes(share=(0.3, 0.5), gain=(0.4, 0.7), lags_s=(0.4, 1.0), most=(0.025, 0.045), store_jpkg=(60.0, 160.0))
class TrailerCarriesItself(Hidden, acts=0.0):
    """A trailer with a driven axle feels what the kingpin pulls and takes part of that on itself, driving or
    holding back, as far as its battery goes: `store`, 0 empty to 1 full. share: of the mass, in the trailer;
    gain: of the pull; most: of the weight; store_jpkg: for each kg of truck.
    Source: makers' descriptions of electrified trailers that are steered by a force sensor in the kingpin,
    and Guzzella and Sciarretta, Vehicle Propulsion Systems (2013), on limits of charge; sizes are chosen
    here."""

    def start(self, batch: int) -> dict[str, Array]:
        return {**super().start(batch), "store": self.rng(1432).uniform(0.2, 0.9, batch)}

    def newtons(self, p: Sizes, s: State, view: View, dt: float) -> Array:
        slope = view.grade + self.truck.rolling_resistance
        pulls = p.share * (np.clip(view.acceleration, -2.0, 2.0) / GRAVITY + slope)
        wish = p.most * np.tanh(p.gain * pulls / p.most)
        room = np.where(wish > 0.0, s.store, 1.0 - s.store)
        s.acts = eased(s.acts, wish * np.clip(room / 0.15, 0.0, 1.0), p.lags_s, dt)
        used = s.acts * GRAVITY * np.maximum(view.speed, 0.0) / p.store_jpkg
        s.store = np.clip(s.store - dt * np.where(used > 0.0, used, 0.7 * used), 0.0, 1.0)
        return s.acts * weight(view) * np.clip(view.speed - 0.5, 0.0, 1.0)


@law("b_rubber_wound_by_braking", "twentieth", "suburban hills")
@sizes(most=(0.03, 0.05), full_m=(45.0, 110.0), gives=(0.6, 0.85), asks=(0.15, 0.35), slips_s=(40.0, 120.0))
class RubberWoundByBraking(Hidden):
    """Ropes of rubber are wound up on a shaft by each braking, and let go with the next pull. They hold by
    how far they are `wound`, so that a short braking gains little, and give somewhat less back. most: of the
    weight, fully wound; full_m: of the way; asks: of the pedal, that lets them go; slips_s: until a ratchet
    has let half of it slip.
    Source: Treloar, The Physics of Rubber Elasticity (1975), on what a stretch stores and loses, and makers'
    notes on elastomer stores for delivery trucks; sizes are chosen here."""

    def start(self, batch: int) -> dict[str, Array]:
        zero = np.zeros(batch)
        return {"wound": self.rng(2034).uniform(0.0, 0.8, batch), "holds": zero.copy(), "lets": zero.copy()}

    def newtons(self, p: Sizes, s: State, view: View, dt: float) -> Array:
        brakes = np.clip(view.brake_force / (0.03 * self.truck.brake_capacity), 0.0, 1.0)
        s.holds = eased(s.holds, brakes * (s.wound < 1.0), 0.25, dt)
        s.lets = eased(s.lets, np.where(self.pedal(view) > p.asks, 1.0, 0.0) * (s.wound > 0.0), 0.3, dt)
        turns = dt * np.maximum(view.speed, 0.0) / p.full_m
        s.wound = s.wound + turns * (s.holds - s.lets) - dt * 0.7 * s.wound / p.slips_s
        s.wound = np.clip(s.wound, 0.0, 1.0)
        force = s.wound / (0.25 + 0.75 * s.wound)
        return p.most * force * (p.gives * s.lets - s.holds) * weight(view) * np.clip(view.speed, 0.0, 1.0)


@law("u_motor_for_the_first_metres", "twenty-first", "suburban")
@sizes(hands_mps=(4.5, 7.5), more=(0.25, 0.5), dips=(0.6, 0.9), dips_s=(0.8, 1.6), tires_s=(25.0, 60.0))
class MotorForTheFirstMetres(Hidden, hot=0.3, was=0.0, dip=0.0, help=0.0):
    """Up to a speed a motor drives beside the engine, which is spared there: together they pull more than
    known, as long as the motor is cool. At the handover the engine alone lacks for a moment. `hot`: of what
    the motor bears. more: of the pull; dips: of the pull, lost at the handover; hands_mps: its speed.
    Source: Guzzella and Sciarretta, Vehicle Propulsion Systems (2013), on parallel hybrids that start by
    their motor; a rough handover, sizes are chosen here."""

    def newtons(self, p: Sizes, s: State, view: View, dt: float) -> Array:
        slow = np.clip((p.hands_mps - view.speed) / 0.5, 0.0, 1.0)
        pull = np.maximum(view.traction_force, 0.0)
        works = slow * np.clip(pull / (0.08 * weight(view)), 0.0, 1.5)
        s.hot = np.clip(s.hot + dt * (works / (0.3 * p.tires_s) - s.hot / p.tires_s), 0.0, 1.2)
        hands = (s.was < p.hands_mps) & (view.speed >= p.hands_mps) & (view.acceleration > 0.0)
        s.was = view.speed.copy()
        s.dip = np.where(hands, 1.0, np.maximum(s.dip - dt / p.dips_s, 0.0))
        s.help = eased(s.help, slow * np.clip(1.6 * (1.0 - s.hot), 0.0, 1.0), 0.2, dt)
        share = p.more * s.help - p.dips * np.sqrt(s.dip)
        return share * pull * np.clip(view.speed, 0.0, 1.0)
