"""An independent implementation of the physics in numpy for a batch, with which the compiled parts are
compared.

Nothing here imports the compiled parts; only the parameters and the initial states come from the package.
"""

from __future__ import annotations

from typing import Any

import numpy as np

OPEN, SLIPPING, LOCKED = 0.0, 1.0, 2.0


class NumpyTruck:
    """Steps a batch of one truck: `state` is a dict of (batch,) arrays, commands and grade are (batch,)."""

    def __init__(self, record: np.void, substeps: int, substep: float) -> None:
        self.p = {name: record[name] for name in record.dtype.names or ()}
        self.substeps, self.h = substeps, substep

    def step(self, state: dict[str, Any], engine: Any, brake: Any, grade: Any) -> np.ndarray[Any, Any]:
        """Advance in place; returns acceleration, speed, fuel rate (batch, 3)."""
        before, fuel = state["speed"].copy(), 0.0
        for _ in range(self.substeps):
            fuel = fuel + self._substep(state, engine, brake, grade)
        mean = (state["speed"] - before) / (self.h * self.substeps)
        return np.stack([mean, state["speed"], fuel / self.substeps], axis=1)

    def _lag(self, x: Any, target: Any, tau: Any) -> Any:
        return x + (target - x) * self.h / (tau + self.h)

    def _full(self, w: Any) -> Any:
        p = self.p
        table = p["full_load"]
        return p["full_load_gain"] * np.interp(w, np.arange(len(table)) * p["table_step"], table)

    def _friction(self, w: Any) -> Any:
        p, w = self.p, np.maximum(w, 40.0)
        motoring = p["friction_constant"] + p["friction_linear"] * w + p["friction_quadratic"] * w**2
        return p["engine_friction"] * motoring + p["accessory_power"] / w

    def _ratio(self, gear: Any) -> Any:
        return self.p["ratios"][np.clip(gear, 1, None).astype(int) - 1]

    def _input_speed(self, s: dict[str, Any], gear: Any) -> Any:
        return self._ratio(gear) * self.p["final_drive"] * s["speed"] / self.p["wheel_radius"]

    def _pull(self, gear: Any, w: Any) -> Any:
        p = self.p
        force_per_torque = (
            self._ratio(gear) * p["final_drive"] * p["driveline_efficiency"] / p["wheel_radius"]
        )
        return self._full(w) * force_per_torque

    def _launch_gear(self, s: dict[str, Any]) -> Any:
        gear = np.full(len(s["speed"]), self.p["start_gear"])
        for _ in range(int(self.p["start_gear"]) - 1):
            gear = gear - ((gear > 1.0) & (self._pull(gear, self.p["launch_speed"]) < 2.0 * s["load"]))
        return gear

    def _gear_for_speed(self, s: dict[str, Any]) -> Any:
        gear, gears = self._launch_gear(s), self.p["gears"]
        for _ in range(int(gears)):
            higher = np.minimum(gear + 1.0, gears)
            gear = np.where(
                (gear < gears) & (self._input_speed(s, higher) >= self.p["engage_speed"]), higher, gear
            )
        return gear

    def _next_gear(self, s: dict[str, Any]) -> Any:
        p, gear = self.p, s["gear"]
        up = p["upshift_low"] + (p["upshift_high"] - p["upshift_low"]) * s["pedal"]
        down = p["downshift_low"] + (p["downshift_high"] - p["downshift_low"]) * s["pedal"]
        speed = self._input_speed(s, gear)
        over = speed > p["governed_speed"]
        wait = (s["since_shift"] < p["time_in_gear"]) & ~over & (speed > p["declutch_speed"])
        higher = np.minimum(gear + 1.0, p["gears"])
        loss = np.maximum(s["load"], 0.0) / p["mass"] * p["shift_time"] * (p["converter"] == 0.0)
        left = np.maximum(1.0 - loss / np.maximum(s["speed"], 0.1), 0.0)
        later = self._input_speed(s, higher) * left
        able = over | ((later > down) & (self._pull(higher, later) > s["load"]))
        upward = (speed > up) & (gear < p["gears"]) & able
        lowest = np.minimum(p["start_gear"], gear)
        lowest = np.where(self._pull(lowest, speed) < s["load"], 1.0, lowest)
        lower = gear
        for _ in range(int(p["gears"])):
            lower = lower - ((lower > lowest) & (self._input_speed(s, lower) < down))
        return np.where(wait, gear, np.where(upward, higher, lower))

    def _gearbox(self, s: dict[str, Any]) -> Any:
        p, converter = self.p, self.p["converter"] > 0.0
        s["pedal"] = self._lag(s["pedal"], np.abs(s["demand"]), 0.3)
        s["since_shift"] = s["since_shift"] + self.h
        changing = s["shift_timer"] > 0.0
        s["shift_timer"] = s["shift_timer"] - self.h * changing
        done = changing & (s["shift_timer"] < 1e-9)
        s["shift_timer"] = np.where(done, 0.0, s["shift_timer"])
        turning = self._input_speed(s, s["gear"])
        behind = (s["clutch"] == SLIPPING) & (turning > p["governed_speed"])
        free = ~changing & ((s["clutch"] == LOCKED) | (converter & (s["clutch"] == OPEN)) | behind)
        slow = turning < p["declutch_speed"]
        loose = ~changing & ~free & (not converter) & ((s["clutch"] == OPEN) | slow)
        wanted = self._next_gear(s)
        start = free & (wanted != s["gear"])
        s["target_gear"] = np.where(start, wanted, s["target_gear"])
        s["shift_timer"] = np.where(start, p["shift_time"], s["shift_timer"])
        done |= start & (p["shift_time"] == 0.0)
        s["gear"] = np.where(done, s["target_gear"], np.where(loose, self._gear_for_speed(s), s["gear"]))
        s["target_gear"] = np.where(loose, s["gear"], s["target_gear"])
        s["since_shift"] = np.where(done, 0.0, s["since_shift"])
        s["clutch"] = np.where(done, OPEN if converter else SLIPPING, s["clutch"])
        s["shifting"] = (s["shift_timer"] > 0.0) * 1.0
        return self._mesh(s)

    def _mesh(self, s: dict[str, Any]) -> Any:
        p, shifting = self.p, s["shifting"] > 0.0
        ramp = np.minimum(s["since_shift"] / p["shift_ramp"], 1.0) if p["shift_ramp"] > 0.0 else 1.0
        old, new = self._ratio(s["gear"]), self._ratio(s["target_gear"])
        s["synchronising"] = np.zeros_like(old)
        if p["converter"] > 0.0:
            s["clutch"] = np.where(shifting, OPEN, s["clutch"])
            keep = p["shift_torque"]
            s["torque_factor"] = np.where(shifting, keep, keep + (1.0 - keep) * ramp)
            part = 1.0 - s["shift_timer"] / p["shift_time"]
            ratio = np.where(shifting, old + part * (new - old), old)
        else:
            elapsed = p["shift_time"] - s["shift_timer"]
            turning = self._input_speed(s, s["gear"]) > p["declutch_speed"]
            fading = shifting & (elapsed < p["shift_ramp"]) & (s["clutch"] == LOCKED) & turning
            apart = shifting & ~fading
            factor = 1.0 - elapsed / p["shift_ramp"] if p["shift_ramp"] > 0.0 else 0.0
            s["torque_factor"] = np.where(fading, factor, np.where(apart, 0.0, ramp))
            s["clutch"] = np.where(apart, OPEN, s["clutch"])
            s["synchronising"] = apart * 1.0
            ratio = np.where(apart, new, old)
        s["ratio"] = ratio * p["final_drive"]
        return s["ratio"] * s["speed"] / p["wheel_radius"]

    def _engine(self, s: dict[str, Any], command: Any, input_speed: Any) -> Any:
        p, w = self.p, s["engine_speed"]
        drag, full = self._friction(w), self._full(w)
        most = np.maximum(full + drag, 1.0)
        torque = command * p["command_scale"] * s["torque_factor"]
        over = np.clip((p["high_idle_speed"] - w) / (p["high_idle_speed"] - p["governed_speed"]), 0.0, 1.0)
        idle = np.clip(drag + 20.0 * (p["idle_speed"] - w), 0.0, most)
        sync = drag + p["engine_inertia"] * (np.maximum(input_speed, p["idle_speed"]) - w) / 0.12
        meshing = s["synchronising"] > 0.0
        wanted = np.where(
            meshing, np.clip(sync, 0.0, most), np.maximum(np.clip(torque, 0.0, most * over), idle)
        )
        retard = np.where(meshing, np.maximum(-sync, 0.0), np.maximum(-torque, 0.0))
        aspirated = np.minimum(p["aspirated_fraction"] * full + drag, most)
        span = np.maximum(most - aspirated, 1e-6)
        lag = p["boost_lag"] * p["boost_speed"] / np.maximum(w, 40.0)
        s["boost"] = self._lag(s["boost"], np.clip((wanted - aspirated) / span, 0.0, 1.0), lag)
        allowed = np.minimum(wanted, aspirated + s["boost"] * span)
        s["indicated_torque"] = self._lag(s["indicated_torque"], allowed, p["fuelling_lag"])
        share = np.clip(
            (w - p["engine_brake_speed"]) / (p["governed_speed"] - p["engine_brake_speed"]), 0.0, 1.0
        )
        retard = np.minimum(retard, p["engine_brake_torque"] * share)
        s["retarder_torque"] = self._lag(s["retarder_torque"], retard, p["engine_brake_lag"])
        s["engine_torque"] = p["torque_gain"] * s["indicated_torque"] - drag - s["retarder_torque"]
        off_speed = (w - p["best_speed"]) / p["best_speed"]
        off_load = 1.0 - s["indicated_torque"] / most
        loss = p["efficiency_speed_loss"] * off_speed**2 + p["efficiency_load_loss"] * off_load**2
        efficiency = p["indicated_efficiency"] * np.maximum(1.0 - loss, 0.3)
        return p["fuel_gain"] * s["indicated_torque"] * w / (efficiency * p["fuel_energy"])

    def _clutch(self, s: dict[str, Any], speed: Any, braked: Any) -> tuple[Any, Any]:
        p, mode, still = self.p, s["clutch"], s["shifting"] == 0.0
        wants = (s["demand"] > 0.02) & ~braked
        if p["converter"] > 0.0:
            release = (mode != OPEN) & (speed < p["lockup_release_speed"])
            fast = (s["gear"] >= p["lockup_gear"]) & (speed > p["lockup_speed"]) & (s["since_shift"] > 0.3)
            new = np.where(release, OPEN, np.where((mode == OPEN) & fast, SLIPPING, mode))
        else:
            low = speed < p["declutch_speed"]
            new = np.where((mode == LOCKED) & low, np.where(wants, SLIPPING, OPEN), mode)
            new = np.where((mode == OPEN) & (wants | (speed > p["engage_speed"])), SLIPPING, new)
            new = np.where((mode == SLIPPING) & ~wants & low, OPEN, new)
        mode = s["clutch"] = np.where(still, new, mode)
        launch = p["idle_speed"] + (p["launch_speed"] - p["idle_speed"]) * s["demand"]
        aim = np.where((p["converter"] == 0.0) & (s["demand"] > 0.0), np.maximum(speed, launch), speed)
        slip = s["engine_torque"] + p["clutch_gain"] * (s["engine_speed"] - aim)
        most = p["clutch_capacity"]
        slip = np.where(s["engine_speed"] >= speed, np.clip(slip, 0.0, most), np.clip(slip, -250.0, 0.0))
        pump, turbine = self._converter(s, speed) if p["converter"] > 0.0 else (0.0, 0.0)
        either = np.where(mode == LOCKED, s["engine_torque"], slip)
        return np.where(mode == OPEN, pump, either), np.where(mode == OPEN, turbine, either)

    def _converter(self, s: dict[str, Any], speed: Any) -> tuple[Any, Any]:
        p, w = self.p, np.maximum(s["engine_speed"], 1.0)
        ratio, soft, k = speed / w, 1.0 - p["coupling_ratio"], p["stall_capacity"]
        back = 1.0 / np.maximum(ratio, 1.0)
        drive = k * w * w * np.minimum((1.0 - ratio) / soft, 1.0)
        overrun = -k * speed * speed * np.minimum((1.0 - back) / soft, 0.3)
        pump = np.where(ratio <= 1.0, drive, overrun)
        gain = 1.0 + (p["stall_torque_ratio"] - 1.0) * np.clip(1.0 - ratio / p["coupling_ratio"], 0.0, 1.0)
        return pump, pump * gain

    def _brakes(self, s: dict[str, Any], command: Any) -> Any:
        p = self.p
        request = np.maximum(command, 0.0) * p["brake_scale"]
        capacity = p["front_wheels"] * p["front_brake_torque"] + p["rear_wheels"] * p["rear_brake_torque"]
        capacity, push = capacity / p["wheel_radius"], p["brake_pushout"]
        wanted = np.minimum(request, 1.0)
        if p["by_deceleration"] > 0.0:
            off = request <= p["brake_gate"]
            integral = (
                p["brake_controller_gain"] * (request + s["acceleration"]) * self.h * (s["speed"] > 0.0)
            )
            held = np.clip(s["brake_controller"] + integral, -4.0, 4.0)
            s["brake_controller"] = np.where(off, np.minimum(s["acceleration"], 0.0), held)
            s["brake_controller"] *= p["brake_controller_gain"] > 0.0
            mass = p["brake_controller_mass"] if p["brake_controller_gain"] > 0.0 else p["mass"]
            share = mass * (request + s["brake_controller"]) / capacity
            wanted = np.where(off, 0.0, np.clip(push + (1.0 - push) * share, 0.0, 1.0))
        for name, lag in (("front_pressure", p["brake_lag"]), ("rear_pressure", p["brake_lag_rear"])):
            s[name] = self._lag(s[name], wanted, np.where(wanted > s[name], lag, p["brake_release_lag"]))
        front, rear = (
            np.maximum(s[n] - push, 0.0) / (1.0 - push) for n in ("front_pressure", "rear_pressure")
        )
        torque = (
            p["front_wheels"] * p["front_brake_torque"] * front
            + p["rear_wheels"] * p["rear_brake_torque"] * rear
        )
        hot = np.maximum(s["brake_temperature"] - p["fade_temperature"], 0.0)
        fade = np.clip(1.0 - p["brake_fade"] * hot, p["fade_floor"], 1.0)
        return p["brake_gain"] * fade * torque / p["wheel_radius"]

    def _substep(self, s: dict[str, Any], command: Any, brake_command: Any, grade: Any) -> Any:
        p, h, v = self.p, self.h, s["speed"]
        torque = command * p["command_scale"]
        most = np.maximum(self._full(s["engine_speed"]) + self._friction(s["engine_speed"]), 1.0)
        retard = np.maximum(torque / max(p["engine_brake_torque"], 1.0), -1.0)
        s["demand"] = np.where(torque >= 0.0, np.minimum(torque / most, 1.0), retard)
        speed = self._gearbox(s)
        fuel = self._engine(s, command, speed)
        cosine = 1.0 / np.sqrt(1.0 + grade**2)
        weight = p["mass"] * p["gravity"]
        grip = p["tyre_friction"] * weight * cosine
        brake = np.minimum(self._brakes(s, brake_command), grip)
        demanded = s["demand"] * most * s["ratio"] / p["wheel_radius"]
        taken, given = self._clutch(s, speed, brake > demanded)
        eta = np.where(given >= 0.0, p["driveline_efficiency"], 1.0 / p["driveline_efficiency"])
        force_per_torque = s["ratio"] / p["wheel_radius"]
        driven = grip * p["drive_axle_share"]
        traction = np.clip(given * force_per_torque * eta, -driven, driven)
        drag = 0.5 * p["air_density"] * p["drag_area"] * v * np.abs(v)
        rolling = (p["rolling_resistance"] + p["rolling_resistance_speed"] * np.abs(v)) * weight * cosine
        slope = weight * grade * cosine
        locked = s["clutch"] == LOCKED
        inertia = p["mass"] + p["wheel_inertia"] / p["wheel_radius"] ** 2
        inertia = inertia + locked * p["engine_inertia"] * force_per_torque**2
        drive, hold = traction - drag - slope, brake + rolling
        stays = (v == 0.0) & ((np.abs(drive) <= hold) | ((drive < 0.0) & (p["hill_hold"] > 0.0)))
        way = np.where(v == 0.0, np.sign(drive), np.sign(v))
        after = v + (drive - way * hold) * h / inertia
        after = np.where(stays | (after * v < 0.0), 0.0, after)
        pull = inertia * (after - v) / h
        share = np.clip((drive - pull) / np.where(hold > 0.0, hold, 1.0), -1.0, 1.0)
        brake = brake * share
        free = s["engine_speed"] + (s["engine_torque"] - taken) * h / p["engine_inertia"]
        turn = np.where(locked, force_per_torque * after, free)
        s["brake_temperature"] = s["brake_temperature"] + self._heating(
            s, np.abs(brake * 0.5 * (v + after)), after
        )
        self._reckon(s, v, after, traction - pull, brake, slope)
        slip_before, slip = s["engine_speed"] - force_per_torque * v, turn - force_per_torque * after
        meets = (
            (s["clutch"] == SLIPPING) & (after > 0.0) & ((slip_before * slip <= 0.0) | (np.abs(slip) <= 0.2))
        )
        together = inertia + p["engine_inertia"] * force_per_torque**2
        s["speed"] = np.where(meets, after + p["engine_inertia"] * force_per_torque * slip / together, after)
        s["engine_speed"] = np.where(meets, force_per_torque * s["speed"], turn)
        s["clutch"] = np.where(meets, LOCKED, s["clutch"])
        s["acceleration"] = (s["speed"] - v) / h
        return fuel

    def _heating(self, s: dict[str, Any], power: Any, speed: Any) -> Any:
        p = self.p
        cooling = p["brake_cooling"] + p["brake_cooling_speed"] * np.abs(speed)
        away = cooling * (s["brake_temperature"] - p["ambient_temperature"])
        return (power - away) * self.h / p["brake_heat_capacity"]

    def _reckon(self, s: dict[str, Any], v: Any, after: Any, felt: Any, brake: Any, slope: Any) -> None:
        p = self.p
        rest = (after == 0.0) & (v == 0.0)
        moving = ~rest & (s["shifting"] == 0.0) & (brake == 0.0)
        load = np.where(moving, s["load"] + (felt - s["load"]) * self.h / (0.5 + self.h), s["load"])
        s["load"] = np.where(rest, slope + p["rolling_resistance"] * p["mass"] * p["gravity"], load)
