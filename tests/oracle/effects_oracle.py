#!/usr/bin/env python3
"""Independent solution of the plant with effects, from the equations of docs/effects.md and docs/model.md alone.

As plant_oracle.py, whose nominal equations it uses, it shares neither code nor method with the Rust plant.  Lags are integrated as
differential equations, and so is the memory of the force hysteresis; a delay shifts the corners of the position command.
Writes effects_oracle.json beside itself; needs numpy and scipy.

    python3 tests/oracle/effects_oracle.py
"""
import json
import pathlib

import numpy as np
from scipy.integrate import solve_ivp
from scipy.optimize import brentq

from plant_oracle import B_C, B_F, BETA, C_1, C_B, GAMMA_1, GAMMA_2, GAMMA_3, J_C, J_F, K_L, OMEGA_L, R_1, R_2, T_L0, XI_0, radius

MGR_OVER_I = 258.0
CONTACT = dict(x_cnt=4.02, x_cls=7.78)

# Null values of everything that a scenario may set; names as in the model description.
NULL = {
    "engine_torque_gain.gain": 1.0, "engine_torque_bias.torque": 0.0, "engine_torque_bias.accessory_power": 0.0,
    "engine_torque_lag.time_constant": 0.0, "engine_torque_lag.curvature": 0.0, "engine_torque_lag.asymmetry": 0.0,
    "actuator_delay.delay": 0.0, "actuator_lag.time_constant": 0.0, "actuator_lag.curvature": 0.0, "actuator_lag.asymmetry": 0.0,
    "kiss_point_offset.offset": 0.0, "kiss_point_offset.closed_offset": 0.0,
    "kiss_point_thermal.slope": 0.0, "kiss_point_thermal.curvature": 0.0, "kiss_point_thermal.closed_share": 0.0,
    "cushion_stiffness_thermal.slope": 0.0, "cushion_stiffness_thermal.curvature": 0.0,
    "cushion_hysteresis.width": 0.0, "cushion_hysteresis.stroke": 0.2,
    "friction_level.factor": 1.0, "friction_fade.depth": 0.0, "friction_fade.onset": 150.0, "friction_fade.width": 30.0,
    "friction_slip_gradient.slope": 0.0, "friction_slip_gradient.reach": 1000.0, "friction_slip_gradient.stribeck": 0.0,
    "friction_slip_gradient.speed": 12.0, "friction_slip_gradient.exponent": 2.0, "friction_slip_gradient.proportional_share": 0.0,
    "clutch_drag.torque": 0.0, "clutch_drag.viscosity": 0.0, "clutch_drag.engaged_share": 1.0,
    "judder.cosine": 0.0, "judder.sine": 0.0, "judder.order": 1.0, "judder.fading": 0.0,
    "heat_partition.share_change": 0.0, "clutch_cooling.body_factor": 1.0, "clutch_cooling.air_factor": 1.0,
    "driveline_compliance.compliance": 0.0, "driveline_compliance.disc_share": 0.1, "driveline_compliance.damping": 1.0,
    "driveline_compliance.soft_angle": 0.0, "driveline_compliance.soft_share": 0.3,
    "road_load.grade": 0.0, "road_load.rolling_torque": 0.0, "vehicle_mass.factor": 1.0,
}

FACES = {
    "kiss_point_offset.offset": 0.15, "kiss_point_offset.closed_offset": -0.1,
    "kiss_point_thermal.slope": -0.002, "kiss_point_thermal.curvature": 3e-6, "kiss_point_thermal.closed_share": 0.6,
    "cushion_stiffness_thermal.slope": 0.0015, "cushion_stiffness_thermal.curvature": -4e-6,
    "friction_level.factor": 1.1, "friction_fade.depth": 0.3, "friction_fade.onset": 90.0, "friction_fade.width": 80.0,
    "friction_slip_gradient.slope": -0.0006, "friction_slip_gradient.reach": 60.0, "friction_slip_gradient.stribeck": 0.05,
    "friction_slip_gradient.speed": 20.0, "friction_slip_gradient.exponent": 1.5, "friction_slip_gradient.proportional_share": 0.4,
    "judder.cosine": 0.06, "judder.sine": -0.08, "judder.order": 1.02, "judder.fading": 1e-4,
    "heat_partition.share_change": 0.2, "clutch_cooling.body_factor": 1.8, "clutch_cooling.air_factor": 2.5,
}
CHAIN = {
    "engine_torque_gain.gain": 0.93, "engine_torque_bias.torque": 4.0, "engine_torque_bias.accessory_power": 400.0,
    "engine_torque_lag.time_constant": 0.12, "engine_torque_lag.curvature": 0.2, "engine_torque_lag.asymmetry": 0.3,
    "actuator_delay.delay": 0.025, "actuator_lag.time_constant": 0.05, "actuator_lag.asymmetry": -0.25,
    "cushion_hysteresis.width": 0.25, "cushion_hysteresis.stroke": 0.5,
}
DRIVE = {
    "driveline_compliance.compliance": 0.004, "driveline_compliance.disc_share": 0.15, "driveline_compliance.damping": 0.6,
    "driveline_compliance.soft_angle": 0.03, "driveline_compliance.soft_share": 0.4,
    "road_load.grade": 0.015, "road_load.rolling_torque": 2.0, "vehicle_mass.factor": 1.15,
}
DRAG = {"clutch_drag.torque": 2.5, "clutch_drag.viscosity": 0.015, "clutch_drag.engaged_share": 0.3}

# Start (ω_f, ω_c, θ_c, θ_b), effects, inputs (t, x_to, T_e_ref, θ_h, T_load) held between corners, and output times.
SCENARIOS = {
    # Open clutch: the engine balance and the drag torque on the disc.
    "open": dict(
        start=(110.0, 0.0, 70.0, 50.0), effects={**CHAIN, **DRAG, **DRIVE, **FACES},
        inputs=[(0.0, 2.0, 10.0, 30.0, 0.0), (0.1, 2.0, 40.0, 30.0, 0.0), (0.5, 3.0, -15.0, 30.0, 0.0)], look=[0.1, 0.3, 0.5, 0.9]),
    # Slip from cold to lock-up, a held torque, opening while driving, re-engagement, lock-up again.
    "launch_and_re_engagement": dict(
        start=(104.71975511965978, 0.0, 60.0, 45.0), effects={**CHAIN, **FACES, **DRAG},
        inputs=[(0.0, 3.0, 30.0, 30.0, 0.0), (0.05, 5.8, 45.0, 30.0, 0.0), (0.6, 6.6, 45.0, 30.0, 0.0), (1.3, 3.5, 5.0, 30.0, 0.0),
                (1.6, 6.4, 30.0, 30.0, 0.0)],
        look=[0.05, 0.3, 0.6, 0.9, 1.2, 1.5, 1.65, 1.8, 2.2]),
    # The same with elastic shafts, hot, with a break-away by torque.
    "shafts_and_break_away": dict(
        start=(120.0, 40.0, 130.0, 80.0), effects={**FACES, **DRIVE, "actuator_lag.time_constant": 0.03, "actuator_lag.curvature": 0.1},
        inputs=[(0.0, 6.3, 35.0, 50.0, 0.0), (0.9, 6.3, 160.0, 50.0, 0.0), (1.1, 6.5, 20.0, 50.0, 0.0)],
        look=[0.2, 0.5, 0.8, 1.0, 1.1, 1.4, 1.8]),
    # The disc is faster: negative slip through lock-up.
    "negative_slip": dict(
        start=(80.0, 130.0, 60.0, 40.0), effects={**CHAIN, **FACES, **DRAG, "road_load.grade": -0.02, "vehicle_mass.factor": 0.9},
        inputs=[(0.0, 5.0, 5.0, 30.0, 0.0), (0.2, 5.9, 5.0, 30.0, 0.0), (1.2, 5.9, -20.0, 30.0, 5.0)], look=[0.2, 0.5, 0.9, 1.2, 1.6]),
    # From standstill with the clutch closed, up a grade, then pulled into slip. An engine that would be turned backwards is covered by val_rest.rs.
    "standstill": dict(
        start=(0.0, 0.0, 40.0, 40.0), effects={**FACES, **DRIVE, "engine_torque_gain.gain": 1.2, "cushion_hysteresis.width": 0.3},
        inputs=[(0.0, 7.5, 12.0, 25.0, 0.0), (0.5, 6.1, 15.0, 25.0, 0.0), (0.8, 6.1, 90.0, 25.0, 0.0)], look=[0.2, 0.5, 0.7, 0.9, 1.1]),
}

# States. The lags of engine and bearing have a value and its rate each; z is the memory of the hysteresis.
F, C, V, TWIST, TC, TB, ANGLE, E, TE, DTE, X, DX, Z = range(13)


class Solution:
    def __init__(self, case):
        self.e = {**NULL, **case["effects"]}
        self.case = case
        e = self.e
        self.j_c = J_C * e["vehicle_mass.factor"]
        self.soft = e["driveline_compliance.compliance"] > 0
        self.j_disc = self.j_c * e["driveline_compliance.disc_share"] if self.soft else self.j_c
        self.events = []

    def normalised(self, x, theta):
        e, d = self.e, theta - 25.0
        shift = e["kiss_point_thermal.slope"] * d + e["kiss_point_thermal.curvature"] * d * d
        kiss = CONTACT["x_cnt"] + e["kiss_point_offset.offset"] + shift
        closed = CONTACT["x_cls"] + e["kiss_point_offset.closed_offset"] + e["kiss_point_thermal.closed_share"] * shift
        return min(1.0, max(0.0, (x - kiss) / (closed - kiss)))

    def force(self, y):
        e, xi, d = self.e, self.normalised(y[X], y[TC]), y[TC] - 25.0
        if xi <= XI_0:
            return 0.0
        spring = BETA[0] * xi + BETA[1] * xi**2 + BETA[2] * xi**3
        thermal = 1 + e["cushion_stiffness_thermal.slope"] * d + e["cushion_stiffness_thermal.curvature"] * d * d
        return spring * (1 + e["cushion_hysteresis.width"] * y[Z] / 2) * max(0.0, thermal)

    def capacity(self, y, slip):
        """Torque capacity at a slip ≥ 0."""
        e, force = self.e, self.force(y)
        if force == 0:
            return 0.0
        per_mu = (R_1 + R_2) * force
        mu = e["friction_level.factor"] * 2 * radius(slip, y[TC]) * force / per_mu
        g = "friction_slip_gradient."
        added = e[g + "slope"] * min(slip, e[g + "reach"]) + e[g + "stribeck"] * np.exp(-(slip / e[g + "speed"]) ** e[g + "exponent"])
        mu += added * (1 - e[g + "proportional_share"] + e[g + "proportional_share"] * mu / 0.3)
        z = 8 * (y[TC] - e["friction_fade.onset"]) / e["friction_fade.width"]
        mu *= 1 - e["friction_fade.depth"] * (np.logaddexp(0, z + 4) - np.logaddexp(0, z - 4)) / 8
        turn = e["judder.order"] * y[ANGLE]
        wave = e["judder.cosine"] * np.cos(turn) + e["judder.sine"] * np.sin(turn)
        return max(0.0, per_mu * mu * (1 + wave / (1 + e["judder.fading"] * slip**2)))

    def drag(self, y, slip):
        e = self.e
        share = e["clutch_drag.engaged_share"]
        share += (1 - share) * np.exp(-self.force(y) / 200.0)
        return share * (e["clutch_drag.torque"] * np.tanh(slip / 3.0) + e["clutch_drag.viscosity"] * slip)

    def vehicle(self, omega, t_load):
        e = self.e
        grade = MGR_OVER_I * np.sin(np.arctan(e["road_load.grade"]))
        return B_C * omega + (T_L0 + e["road_load.rolling_torque"]) * np.tanh(omega / OMEGA_L) + K_L * omega * abs(omega) + grade + t_load

    def shafts(self, y):
        e = self.e
        a, q, c = (e["driveline_compliance." + k] for k in ("soft_angle", "soft_share", "compliance"))
        # Soft within ±a, stiff beyond it.
        twist = abs(y[TWIST])
        torque = (q * min(twist, a) + max(0.0, twist - a)) / c
        return np.copysign(torque, y[TWIST]) + e["driveline_compliance.damping"] * (y[C] - y[V])

    def crankshaft(self, y):
        return y[TE] - self.e["engine_torque_bias.accessory_power"] / max(y[F], 50.0)

    def behind(self, y, t_load):
        return self.shafts(y) if self.soft else self.vehicle(y[C], t_load)

    def holding(self, y, t_load):
        return (self.j_disc * (self.crankshaft(y) - B_F * y[F]) + J_F * self.behind(y, t_load)) / (J_F + self.j_disc)

    def lag(self, name, target, value, rate):
        """Derivatives of a lag's value and of its rate; a first-order lag has no rate state."""
        tau, kappa, a = (self.e[f"{name}.{k}"] for k in ("time_constant", "curvature", "asymmetry"))
        tau *= 1 + a * np.sign(target - value)
        if kappa == 0:
            return (target - value) / tau, 0.0
        return rate, (target - value - tau * rate) / (kappa * tau**2)

    def rates(self, u, direction, y):
        _, x_cmd, report, theta_h, t_load = u
        e, d = self.e, np.zeros(13)
        if e["engine_torque_lag.time_constant"] > 0:
            target = e["engine_torque_gain.gain"] * report + e["engine_torque_bias.torque"]
            d[TE], d[DTE] = self.lag("engine_torque_lag", target, y[TE], y[DTE])
        if e["actuator_lag.time_constant"] > 0:
            d[X], d[DX] = self.lag("actuator_lag", x_cmd, y[X], y[DX])
            d[Z] = 2 * abs(d[X]) * (np.sign(d[X]) - y[Z]) / e["cushion_hysteresis.stroke"]
        slip = y[F] - y[C]
        friction = t_fc = self.holding(y, t_load)
        if direction != 0:
            friction = direction * self.capacity(y, max(0.0, direction * slip))
            t_fc = friction + self.drag(y, slip)
        behind = self.behind(y, t_load)
        d[F] = (self.crankshaft(y) - B_F * y[F] - t_fc) / J_F
        d[C] = (t_fc - behind) / self.j_disc if direction != 0 else d[F]
        d[V] = (behind - self.vehicle(y[V], t_load)) / (self.j_c - self.j_disc) if self.soft else d[C]
        d[TWIST] = y[C] - y[V] if self.soft else 0.0
        power = friction * slip if direction != 0 else 0.0
        gamma_1, gamma_2 = GAMMA_1 * e["clutch_cooling.body_factor"], GAMMA_2 * e["clutch_cooling.air_factor"]
        gamma_3 = min(1.0, max(0.0, GAMMA_3 + e["heat_partition.share_change"]))
        if self.normalised(y[X], y[TC]) > XI_0:
            d[TC] = (gamma_1 * (y[TB] - y[TC]) + gamma_3 * power) / C_1
            d[TB] = (gamma_1 * (y[TC] - y[TB]) + gamma_2 * (theta_h - y[TB]) + (1 - gamma_3) * power) / C_B
        else:
            d[TC] = gamma_2 * (theta_h - y[TC]) / C_1
            d[TB] = 2 * gamma_2 * (theta_h - y[TB]) / C_B
        if direction != 0:
            d[ANGLE] = slip
            d[E] = t_fc * slip
        return d

    def excess(self, u, direction, y):
        """Event function, which changes from negative to positive at the event that ends this motion."""
        if direction == 0:
            return abs(self.holding(y, u[4])) - self.capacity(y, 0.0)
        return -direction * (y[F] - y[C])

    def at_one_speed(self, u, y):
        hold = self.holding(y, u[4])
        return 0 if abs(hold) <= self.capacity(y, 0.0) else (1 if hold > 0 else -1)

    def segment(self, u, direction, t, end, y):
        while t < end:
            if direction == 0 and self.excess(u, 0, y) > 0:
                direction = 1 if self.holding(y, u[4]) > 0 else -1
                self.events.append(dict(time=t, what="break-away"))
            sol = solve_ivp(lambda _, s: self.rates(u, direction, s), (t, end), y, method="DOP853", rtol=1e-11, atol=1e-11, dense_output=True, max_step=0.01)
            grid = np.unique(np.concatenate([sol.t, np.linspace(t, end, 400)]))
            values = [self.excess(u, direction, sol.sol(s)) for s in grid]
            hit = next((k for k in range(1, len(grid)) if values[k] > 0 and grid[k] > t + 1e-9), None)
            if hit is None:
                return direction, sol.y[:, -1]
            low = grid[hit - 1] if values[hit - 1] <= 0 else t
            t = brentq(lambda s: self.excess(u, direction, sol.sol(s)), low, grid[hit], xtol=1e-15)
            y = sol.sol(t)
            if direction == 0:
                direction = 1 if self.holding(y, u[4]) > 0 else -1
                self.events.append(dict(time=t, what="break-away"))
            else:
                y[F] = y[C] = (J_F * y[F] + self.j_disc * y[C]) / (J_F + self.j_disc)
                direction = self.at_one_speed(u, y)
                self.events.append(dict(time=t, what="lock-up" if direction == 0 else "reversal"))
        return direction, y

    def solve(self):
        e, case = self.e, self.case
        delay = e["actuator_delay.delay"]
        inputs = case["inputs"]
        target = lambda u: e["engine_torque_gain.gain"] * u[2] + e["engine_torque_bias.torque"]
        w_f, w_c, theta_c, theta_b = case["start"]
        y = np.zeros(13)
        y[[F, C, V, TC, TB, TE, X]] = w_f, w_c, w_c, theta_c, theta_b, target(inputs[0]), inputs[0][1]
        direction = int(np.sign(w_f - w_c)) if w_f != w_c else self.at_one_speed(inputs[0], y)
        corners = {*case["look"], *(u[0] for u in inputs), *(u[0] + delay for u in inputs[1:])}
        rows, t = [], 0.0
        for stop in sorted(corners):
            if stop > case["look"][-1]:
                break
            if stop > t:
                now = [u for u in inputs if u[0] <= t + 1e-12][-1]
                commanded = [u for u in inputs if u[0] + (delay if u[0] > 0 else 0) <= t + 1e-12][-1]
                u = (t, commanded[1], *now[2:])
                if e["engine_torque_lag.time_constant"] == 0:
                    y[TE] = target(u)
                if e["actuator_lag.time_constant"] == 0 and u[1] != y[X]:
                    # The memory of the hysteresis over a step of the position: its law integrated in closed form.
                    travel = u[1] - y[X]
                    side = np.sign(travel)
                    y[Z] = side + (y[Z] - side) * np.exp(-2 * abs(travel) / e["cushion_hysteresis.stroke"])
                    y[X] = u[1]
                direction, y = self.segment(u, direction, t, stop, y)
                t = stop
            if stop in case["look"]:
                t_fc = self.holding(y, u[4]) if direction == 0 else direction * self.capacity(y, abs(y[F] - y[C])) + self.drag(y, y[F] - y[C])
                names = dict(omega_f=F, omega_c=C, omega_v=V, theta_c=TC, theta_b=TB, e_d=E, x_to_actual=X)
                rows.append(dict(time=t, **{k: y[i] for k, i in names.items()}, t_fc=t_fc, stuck=direction == 0))
        return dict(start=case["start"], effects=case["effects"], inputs=inputs, events=self.events, rows=rows)


if __name__ == "__main__":
    result = {name: Solution(case).solve() for name, case in SCENARIOS.items()}
    pathlib.Path(__file__).with_suffix(".json").write_text(json.dumps(result, indent=1) + "\n")
    for name, found in result.items():
        print(name, [(e["what"], round(e["time"], 6)) for e in found["events"]], found["rows"][-1])
