"""Brakes: fade, lag, drag."""

from __future__ import annotations

import numpy as np

from deeptruck_core.arrays import Array
from deeptruck_exam.laws.catalogue import law, sizes
from deeptruck_exam.laws.law import STEP_S, Law, Sizes, State, moving
from deeptruck_model.trucks import View


@law("brake_fade", "descent")
@sizes(surface_share=(0.10, 0.20), onset_c=(110.0, 170.0), width_k=(60.0, 130.0), loss=(0.30, 0.55))
class TwoMassFade(Law):
    """Brake fade with two thermal masses, the rubbing surface and the drum, initially 20 K above ambient.
    surface_share: share of the drums' heat capacity; loss: share of the torque lost at full temperature.
    Source: Limpert, Brake Design and Safety, and Day, Braking of Road Vehicles (2014), on brake temperature
    and fade."""

    def start(self, batch: int) -> dict[str, Array]:
        ambient = np.full(batch, self.truck.ambient_temperature)
        return {"surface": ambient + 20.0, "body": ambient.copy()}

    def newtons(self, p: Sizes, s: State, view: View, dt: float) -> Array:
        truck = self.truck
        hot = (s.surface - p.onset_c) / p.width_k
        lost = p.loss * np.where(hot > 0.0, 1.0 - np.exp(-(np.maximum(hot, 0.0) ** 2)), 0.0)
        capacity = 0.6 * truck.brake_heat_capacity  # J/K, of drums and linings without the hubs
        inward = 0.02 * capacity * (s.surface - s.body)  # W; 50 s to level out
        outward = (truck.brake_cooling + truck.brake_cooling_speed * view.speed) * (
            s.body - truck.ambient_temperature
        )
        power = (1.0 - lost) * view.brake_force * view.speed
        s.surface += dt * (power - inward) / (p.surface_share * capacity)
        s.body += dt * (inward - outward) / ((1.0 - p.surface_share) * capacity)
        return lost * view.brake_force * moving(view)


SKIN_S = np.array([3.0, 15.0, 75.0])[:, None]  # s, of layers ever deeper below the rubbing face
SKIN = np.array([0.5, 0.3, 0.2])[:, None]  # shares: twofold about the root of time, 1 to 60 s


@law("brake_fade", "descent")
@sizes(most=(0.35, 0.6), half_wpkg=(3.0, 5.0), steep=(2.5, 4.5))
class LayeredDrumFade(Law):
    """Brake fade that is small at the end of one hard stop and builds up over minutes on a long descent.
    most: largest share of the brake force lost; half_wpkg: steady power over mass at which half of it is
    lost.
    Source: Carslaw and Jaeger, Conduction of Heat in Solids (1959): the temperature of the rubbing face
    follows the heat flow with the root of time, here as layers of three depths; fade tests of type I, UN
    Regulation No. 13, annex 4."""

    def start(self, batch: int) -> dict[str, Array]:
        return {"face": np.zeros((3, batch))}

    def newtons(self, p: Sizes, s: State, view: View, dt: float) -> Array:
        hot = np.maximum((SKIN * s.face).sum(axis=0), 0.0) / p.half_wpkg
        lost = p.most * hot**p.steep / (1.0 + hot**p.steep)
        power = (1.0 - lost) * view.brake_force * np.maximum(view.speed, 0.0) / view.mass
        s.face = s.face + dt * (power - s.face) / SKIN_S
        return lost * view.brake_force * moving(view)


@law("brake_lag", "suburban descent", accepts="command_delay clock_offset")
@sizes(dead_time_s=(0.10, 0.35), fill_rate=(0.7, 1.6))
class ChamberFilling(Law):
    """Choked flow fills the brake chamber with the square root of the pressure difference, after a transport
    delay. fill_rate: share of full force per second at full difference.
    Source: Subramanian, Darbha and Rajagopal, J. Dyn. Sys. Meas. Control 126 (2004)."""

    def start(self, batch: int) -> dict[str, Array]:
        self.steps = max(1, round(self.p.dead_time_s / STEP_S))
        return {"pipe": np.zeros((self.steps, batch)), "chamber": np.zeros(batch), "at": np.zeros(1, int)}

    def newtons(self, p: Sizes, s: State, view: View, dt: float) -> Array:
        full = 2.0e5  # N, of all brakes at full pressure
        slot = int(s.at[0]) % self.steps
        arrived = s.pipe[slot].copy()
        s.pipe[slot] = view.brake_force / full
        s.at[0] += 1
        difference = arrived - s.chamber
        rate = p.fill_rate * np.sign(difference) * np.sqrt(np.abs(difference))
        change = np.clip(rate * dt, -np.abs(difference), np.abs(difference))
        s.chamber += change
        return (view.brake_force - full * s.chamber) * moving(view)


@law("brake_lag", "suburban descent", accepts="command_delay clock_offset")
@sizes(share=(0.55, 0.9), crack=(0.012, 0.035), fill=(0.12, 0.30), empty_s=(0.5, 1.3))
class RelayValve(Law, chamber=0.0, open=0.0):
    """Small changes are not transmitted; large ones fill at a constant rate and release exponentially. share:
    share of the brake force behind the valve; crack: share of full force; fill: share of full force per
    second.
    Source: Natarajan, Subramanian, Darbha and Rajagopal, A Model of the Relay Valve Used in an Air Brake
    System, Nonlinear Analysis: Hybrid Systems 1 (2007): the valve laps until the difference exceeds a crack
    pressure, then fills choked."""

    def newtons(self, p: Sizes, s: State, view: View, dt: float) -> Array:
        full = self.truck.brake_capacity
        asked = view.brake_force / full
        away = asked - s.chamber
        released = (asked < 0.002) & (s.chamber > 0.0)  # a quick-release valve needs no crack pressure
        s.open = np.where((np.abs(away) > p.crack) | released, 1.0, s.open * (np.abs(away) > 0.2 * p.crack))
        change = np.where(away > 0.0, np.minimum(p.fill * dt, away), away * min(dt / p.empty_s, 1.0))
        s.chamber += s.open * change
        return p.share * full * (asked - s.chamber) * moving(view)


@law("dragging_brake", "suburban descent")
@sizes(floor_n=(300.0, 900.0), stuck_n=(900.0, 3000.0), ease_s=(12.0, 45.0), swell=(0.1, 0.5))
class StickingCam(Law, stuck=0.0, heat=0.0):
    """A residual drag after each application (in full from 20 kN on) that decays, and grows with heat. swell:
    per 4 MJ of heat, which decays within about 200 s.
    Source: Limpert, Brake Design and Safety, on air brake adjustment and residual shoe force."""

    def newtons(self, p: Sizes, s: State, view: View, dt: float) -> Array:
        applied = np.clip(view.brake_force / 2.0e4, 0.0, 1.0)
        s.stuck = np.maximum(s.stuck * (1.0 - dt / p.ease_s), p.stuck_n * applied)
        drag = (p.floor_n + s.stuck) * (1.0 + p.swell * s.heat)
        s.heat += dt * (drag * view.speed / 4.0e6 - s.heat / 200.0)
        return -drag * moving(view)


@law("dragging_brake", "suburban descent")
@sizes(hold_bar=(5.6, 6.4), per_bar_n=(2200.0, 4500.0), use_bar=(0.10, 0.25), refill_s=(20.0, 45.0))
class SpringBrakes(Law):
    """Every application consumes air, and low pressure applies the spring brakes until the compressor, faster
    at higher engine speed, has refilled. use_bar: per second of braking at 25 kN; refill_s: at 130 rad/s
    engine speed, towards the governor's 7.5 bar; leaks take 0.012 bar/s.
    Source: Limpert, Brake Design and Safety, on spring brakes; FMVSS 121 S5.1 on the compressor's build-up
    with engine speed."""

    def start(self, batch: int) -> dict[str, Array]:
        return {"air": self.rng(104).uniform(4.8, 6.6, batch)}

    def newtons(self, p: Sizes, s: State, view: View, dt: float) -> Array:
        used = p.use_bar * np.clip(view.brake_force / 2.5e4, 0.0, 1.5)
        refill = np.clip(view.engine_speed / 130.0, 0.4, 1.6) * (7.5 - s.air) / p.refill_s
        s.air = np.clip(s.air + dt * (refill - used - 0.012), 3.5, 7.5)
        short = np.maximum(p.hold_bar - s.air, 0.0)
        return -p.per_bar_n * np.minimum(short, 1.5) * moving(view)
