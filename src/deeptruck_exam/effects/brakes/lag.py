"""Brakes that come and go late."""

from __future__ import annotations

from functools import partial

import numpy as np

from deeptruck_exam.effects.law import Array, Hidden, Sizes, State, moving
from deeptruck_exam.effects.planting import hidden, sizes
from deeptruck_exam.effects.series import spells, within
from deeptruck_model.trucks import View

law = partial(hidden, name="brake_lag", accepts="command_delay clock_offset")


@law("brake_lag", "first", "suburban descent")
@sizes(dead_time_s=(0.10, 0.35), fill_rate=(0.7, 1.6))
class BrakeLag(Hidden):
    """fill_rate: 1/s of full force at full difference.
    Source: Subramanian, Darbha and Rajagopal, J. Dyn. Sys. Meas. Control 126 (2004): choked flow fills the
    chamber at a rate with the square root of the pressure difference, after a transport delay."""

    def start(self, batch: int) -> dict[str, Array]:
        self.steps = max(1, round(self.p.dead_time_s / 0.01))
        return {"pipe": np.zeros((self.steps, batch)), "chamber": np.zeros(batch), "at": np.zeros(1, int)}

    def newtons(self, p: Sizes, s: State, view: View, dt: float) -> Array:
        full = 2.0e5
        slot = int(s.at[0]) % self.steps
        arrived = s.pipe[slot].copy()
        s.pipe[slot] = view.brake_force / full
        s.at[0] += 1
        difference = arrived - s.chamber
        rate = p.fill_rate * np.sign(difference) * np.sqrt(np.abs(difference))
        change = np.clip(rate * dt, -np.abs(difference), np.abs(difference))
        s.chamber += change
        return (view.brake_force - full * s.chamber) * moving(view)


@law("relay_valve_sticks", "second", "suburban descent")
@sizes(share=(0.55, 0.9), crack=(0.012, 0.035), fill=(0.12, 0.30), empty_s=(0.5, 1.3))
class RelayValve(Hidden, chamber=0.0, open=0.0):
    """Small changes never arrive; large ones arrive at a constant rate and leave exponentially. share: of the
    brake force behind the valve; crack: of full force; fill: 1/s of full force.
    Source: Natarajan, Subramanian, Darbha and Rajagopal, A Model of the Relay Valve Used in an Air Brake
    System, Nonlinear Analysis: Hybrid Systems 1 (2007): the valve laps until the difference exceeds a crack
    pressure, then fills choked; band and rates are chosen here."""

    def newtons(self, p: Sizes, s: State, view: View, dt: float) -> Array:
        full = self.truck.brake_capacity
        asked = view.brake_force / full
        away = asked - s.chamber
        released = (asked < 0.002) & (s.chamber > 0.0)  # a quick-release valve needs no crack pressure
        s.open = np.where((np.abs(away) > p.crack) | released, 1.0, s.open * (np.abs(away) > 0.2 * p.crack))
        change = np.where(away > 0.0, np.minimum(p.fill * dt, away), away * min(dt / p.empty_s, 1.0))
        s.chamber += s.open * change
        return p.share * full * (asked - s.chamber) * moving(view)


@law("long_pipes", "third", "suburban descent")
@sizes(share=(0.5, 0.85), lump_s=(0.22, 0.5), slower_out=(1.2, 2.2))
class LongPipes(Hidden):
    """Linear: small changes come as late as large ones.
    Source: Response times of trailing axles, UN Regulation No. 13, annex 6, and Limpert, Brake Design and
    Safety, on pneumatic lines; three lumps of a pipe in a row that empty slower than they fill, numbers of a
    train without electronic control chosen here."""

    def start(self, batch: int) -> dict[str, Array]:
        return {"lumps": np.zeros((3, batch))}

    def newtons(self, p: Sizes, s: State, view: View, dt: float) -> Array:
        lumps = s.lumps
        before = np.concatenate([view.brake_force[None], lumps[:-1]])
        slower = np.where(before < lumps, p.slower_out, 1.0)
        lumps += dt * (before - lumps) / (p.lump_s * slower)
        return p.share * (view.brake_force - lumps[-1]) * moving(view)


@law("chamber_stroke", "fourth", "suburban descent")
@sizes(share=(0.6, 0.95), stroke=(0.35, 0.8), rise=(0.07, 0.15), return_s=(0.5, 1.5))
class ChamberStroke(Hidden, rod=0.0, chamber=0.0):
    """stroke, rise: 1/s for each bar of absolute supply pressure; pressures over full pressure of 8.5 bar.
    Source: ISO 6358 flow through a fixed conductance (choked, then an ellipse) into a brake chamber that must
    first be filled over the stroke of its push rod (SAE J1469 on chamber volumes; Limpert, Brake Design and
    Safety): gentle applications fill it slowly; conductances of long hoses, chosen here."""

    @staticmethod
    def flow(up: Array, down: Array) -> Array:
        beyond = np.clip((np.clip(down / up, 0.0, 1.0) - 0.3) / 0.7, 0.0, 1.0)
        return np.asarray(up * np.sqrt(1.0 - beyond**2))

    def newtons(self, p: Sizes, s: State, view: View, dt: float) -> Array:
        full = self.truck.brake_capacity
        supply = view.brake_force / full
        asked, inside = 1.0 + 8.5 * supply, 1.0 + 8.5 * s.chamber
        filling = (supply > s.chamber + 1e-4) & (supply > 0.002)
        touches = s.rod >= 1.0
        s.rod = np.where(
            filling,
            np.minimum(s.rod + dt * p.stroke * self.flow(asked, np.ones_like(asked)), 1.0),
            np.where(supply < 0.002, np.maximum(s.rod - dt / p.return_s, 0.0), s.rod),
        )
        rise = dt * p.rise * self.flow(asked, inside) * touches
        fall = dt * 1.6 * p.rise * self.flow(inside, np.ones_like(inside))
        s.chamber = np.where(
            filling, np.minimum(s.chamber + rise, supply), np.maximum(s.chamber - fall, supply)
        )
        return p.share * full * (supply - s.chamber) * moving(view)


@law("tanks_run_low", "fifth", "suburban descent")
@sizes(share=(0.55, 0.85), fills_s=(0.35, 0.8), draws=(0.10, 0.28), pumps_s=(60.0, 160.0), vents_s=(0.2, 0.7))
class TanksRunLow(Hidden):
    """tank: from 1 full to 0.3, where spring brakes would come on. share: of the brakes on the far tank;
    fills_s: with full tanks; draws: of the tank, by one full application.
    Source: Repeated applications empty the reservoirs and slow the next one (FMVSS 121 S5.1.2 on reservoir
    volumes; UN Regulation No. 13, annex 7, on energy after eight strokes): flow with the root of the pressure
    left, from a compressor that is geared to the engine; leaking trains, sizes chosen here."""

    def start(self, batch: int) -> dict[str, Array]:
        return {"tank": self.rng(431).uniform(0.6, 1.0, batch), "inside": np.zeros(batch)}

    def newtons(self, p: Sizes, s: State, view: View, dt: float) -> Array:
        full = self.truck.brake_capacity
        asked = view.brake_force / full
        drop = np.maximum(s.tank - s.inside, 0.05)
        up = np.sqrt(drop) * s.tank / p.fills_s * np.maximum(asked - s.inside, 0.0)
        up = np.minimum(up, 0.5 * s.tank / p.fills_s)
        down = np.maximum(s.inside - asked, 0.0) / p.vents_s
        s.inside = np.clip(s.inside + dt * (up - down), 0.0, 1.2)
        pumped = np.clip(view.engine_speed / 150.0, 0.3, 1.5) * (1.0 - s.tank) / p.pumps_s
        s.tank = np.clip(s.tank + dt * (pumped - 2.5 * p.draws * up), 0.3, 1.0)
        return p.share * full * (asked - s.inside) * moving(view)


@law("falls_back_on_air", "sixth", "suburban descent")
@sizes(share=(0.5, 0.8), dead_s=(0.25, 0.6), fills_per_s=(0.05, 0.15), vents_s=(0.4, 1.2))
class FallsBackOnAir(Hidden, inside=0.0, asks=0.0):
    """As quick as the simulator knows it while the plug has contact. share: of the brakes behind the plug;
    fills_per_s: of full braking.
    Source: Electronically controlled trailers fall back on the pneumatic control line where the data line of
    ISO 7638 fails (UN Regulation No. 13, on electric control lines): a dead time and a steady fill through a
    relay valve; a corroded plug that comes and goes, sizes chosen here."""

    def prepare(self) -> None:
        rng = self.rng(503)
        self.fails = spells(rng, self.setting.batch, (40.0, 110.0), (8.0, 35.0))

    def newtons(self, p: Sizes, s: State, view: View, dt: float) -> Array:
        full = self.truck.brake_capacity
        asked = view.brake_force / full
        # the dead time is met once in each application
        s.asks = np.where(asked > 0.002, s.asks + dt, 0.0)
        up = np.minimum(np.maximum(asked - s.inside, 0.0), dt * p.fills_per_s * (s.asks > p.dead_s))
        down = np.maximum(s.inside - asked, 0.0) * dt / p.vents_s
        fails = within(self.fails, view.time) > 0.5
        s.inside = np.where(fails, s.inside + up - down, asked)
        return p.share * full * (asked - s.inside) * moving(view)


@law("orifice_chokes", "seventh", "suburban descent")
@sizes(share=(0.55, 0.9), fills_per_s=(0.5, 1.4), first=(0.01, 0.03))
class OrificeChokes(Hidden, inside=0.0):
    """inside: pressure over the full one; a gentle brake waits longest for the shoes to come. share: of the
    brakes behind it; fills_per_s: of the pressure ahead; first: to move the shoes.
    Source: FMVSS 121 S5.3.3 and S5.3.4 and UN Regulation No. 13, annex 6, response times on the bench: air
    passes a narrow coupling at the speed of sound until the chamber has half of the pressure ahead of it,
    then ever slower (Saint-Venant and Wantzel); a wrong coupling's bore."""

    def newtons(self, p: Sizes, s: State, view: View, dt: float) -> Array:
        full = self.truck.brake_capacity
        asked = view.brake_force / full
        ahead = np.where(asked > 0.0, asked + p.first, 0.0)
        ratio = np.clip(s.inside / np.maximum(ahead, 1e-6), 0.0, 1.0)
        flow = np.sqrt(np.clip(1.0 - ((ratio - 0.528) / 0.472) ** 2, 0.0, 1.0))
        rise = p.fills_per_s * ahead * np.where(ratio < 0.528, 1.0, flow)
        fall = 1.7 * p.fills_per_s * np.sqrt(np.maximum(s.inside, 0.0) * np.maximum(s.inside - ahead, 0.0))
        up = np.minimum(dt * rise, np.maximum(ahead - s.inside, 0.0))
        s.inside = s.inside + np.where(ahead > s.inside, up, -dt * fall - dt * 0.02 * (ahead <= 0.0))
        s.inside = np.maximum(s.inside, 0.0)
        felt = np.maximum(s.inside - p.first, 0.0)
        return p.share * full * (asked - felt) * moving(view)


@law("s_pulsed_valves", "eighth", "suburban descent")
@sizes(step=(0.015, 0.035), pulse_s=(0.15, 0.35), share=(0.7, 1.0), vents=(1.0, 2.0))
class PulsedValves(Hidden, held=0.0, clock=0.0, wanted=0.0):
    """step: of the full force, for each pulse.
    Source: Pneumatic brakes driven by on-off valves rise and fall by pulses (Kienhöfer, Miller and Cebon,
    Design Concepts for an Alternative Heavy Vehicle ABS System, Vehicle System Dynamics 46, 2008); slow
    valves, sizes are chosen here."""

    def newtons(self, p: Sizes, s: State, view: View, dt: float) -> Array:
        full = self.truck.brake_capacity
        asked = view.brake_force / full
        s.clock = s.clock + dt
        pulse = s.clock >= p.pulse_s
        step = np.clip(asked - s.wanted, -p.vents * p.step, p.step)
        s.wanted = np.where(pulse, s.wanted + step, s.wanted)
        s.clock = np.where(pulse, s.clock - p.pulse_s, s.clock)
        s.held = s.held + dt * (s.wanted - s.held) / 0.12
        return p.share * full * (asked - s.held) * moving(view)


@law("w_regulator_rings", "twelfth", "suburban descent")
@sizes(hz=(0.4, 0.75), damping=(0.3, 0.6), dead_s=(0.0, 0.2), share=(0.7, 1.0), vents=(0.7, 1.0))
class RegulatorRings(Hidden, bar=0.0, pace=0.0, heard=0.0):
    """The pressure of the far axles is regulated by a loop that is slow and rings: it comes late, goes too
    far and comes back; letting go, a little slower still. vents: of the loop's own speed, downwards.
    Source: Subramanian, Darbha and Rajagopal, Modeling the Pneumatic Subsystem of an S-cam Air Brake System,
    J. Dyn. Sys. Meas. Control 126 (2004), on pressure transients, and Astrom and Hagglund, PID Controllers
    (1995), on loops tuned too sharply; frequencies are chosen here."""

    def newtons(self, p: Sizes, s: State, view: View, dt: float) -> Array:
        full = self.truck.brake_capacity
        asked = view.brake_force / full
        s.heard = s.heard + dt * (asked - s.heard) / (0.06 + p.dead_s)
        omega = 2.0 * np.pi * p.hz * np.where(s.heard < s.bar, p.vents, 1.0)
        s.pace = s.pace + dt * (omega**2 * (s.heard - s.bar) - 2.0 * p.damping * omega * s.pace)
        bar = s.bar + dt * s.pace
        s.pace = np.where((bar < 0.0) & (s.pace < 0.0), 0.0, s.pace)
        s.bar = np.clip(bar, 0.0, 1.5)
        return p.share * full * (asked - s.bar) * moving(view)
