#!/usr/bin/env python3
"""Independent solution of the nominal plant, from the equations of docs/model.md and the paper alone.

It shares no code with the Rust plant and no method: an adaptive Runge-Kutta method of order 8(5,3) at a tolerance of 1e-13 between
events that a root finder locates on dense output, scipy's adaptive quadrature for the equivalent radius (3), and piecewise constant
inputs that are switched at their corners.  Writes plant_oracle.json beside itself; needs numpy and scipy.

    python3 tests/oracle/plant_oracle.py
"""
import json
import pathlib

import numpy as np
from scipy.integrate import quad, solve_ivp
from scipy.optimize import brentq

R_1, R_2, MU_0, ALPHA_1, ALPHA_2 = 0.074, 0.108, 0.15, 0.02, 0.3
M = (0.1834, 0.0024, -7.06e-06)
BETA = (26.1195, -1304.6, 5818.5)
C_1, C_B, GAMMA_1, GAMMA_2, GAMMA_3 = 70.0, 6928.0, 14.58, 25.0, 0.5
J_F, J_C, B_F, B_C, T_L0, OMEGA_L, K_L = 0.189, 0.578, 0.030, 0.012, 3.1, 0.5, 2e-05
XI_0 = max(np.roots([BETA[2], BETA[1], BETA[0]]).real)

# Start, contact polynomials, inputs held between corners, and output times. x_to in mm.
SCENARIOS = {
    # Launch from cold, lock-up, then a torque that the closed clutch holds.
    "launch": dict(
        start=(104.71975511965978, 0.0, 25.0, 25.0), x_cnt=(4.02, 0.0, 0.0), x_cls=(7.78, 0.0, 0.0),
        inputs=[(0.0, 5.6, 30.0, 25.0, 0.0), (0.4, 6.4, 45.0, 25.0, 0.0), (0.9, 6.9, 40.0, 25.0, 0.0), (1.5, 8.2, 60.0, 25.0, 0.0)],
        look=[0.2, 0.4, 0.8, 1.2, 1.6, 2.0]),
    # Hot clutch with contact points that move with temperature, a load step, lock-up, break-away by torque, lock-up again.
    "hot_break_away": dict(
        start=(150.0, 60.0, 140.0, 90.0), x_cnt=(4.02, -1.5e-3, 2e-6), x_cls=(7.78, -1.0e-3, 1e-6),
        inputs=[(0.0, 6.2, 40.0, 60.0, 5.0), (0.8, 6.2, 20.0, 60.0, 5.0), (1.2, 6.2, 150.0, 60.0, 5.0), (1.5, 6.2, 10.0, 60.0, 12.0), (2.2, 4.0, 5.0, 60.0, 12.0)],
        look=[0.3, 0.7, 1.0, 1.2, 1.35, 1.5, 2.0, 2.5]),
    # The disc is faster than the engine: negative slip, the vehicle drives the engine up, then lock-up and coasting.
    "overrun": dict(
        start=(80.0, 130.0, 60.0, 40.0), x_cnt=(4.02, 0.0, 0.0), x_cls=(7.78, 0.0, 0.0),
        inputs=[(0.0, 5.4, 5.0, 30.0, -4.0), (0.5, 6.0, 5.0, 30.0, 8.0), (1.4, 6.0, -20.0, 30.0, 8.0)],
        look=[0.25, 0.5, 0.9, 1.4, 1.9]),
}


def mu(omega, theta):
    mu_d = M[0] + M[1] * theta + M[2] * theta**2
    return max(0.02, mu_d + (MU_0 - mu_d + ALPHA_1 * omega) * np.exp(-ALPHA_2 * omega))


def radius(omega, theta):
    rho_m = (R_1 + R_2) / 2
    integral, _ = quad(lambda rho: mu(omega * rho / rho_m, theta) * rho, R_1, R_2, epsabs=1e-16, epsrel=1e-13)
    return integral / (R_2 - R_1)


def normalised(case, x, theta):
    d = theta - 25.0
    kiss, closed = (np.polyval(case[k][::-1], d) for k in ("x_cnt", "x_cls"))
    return min(1.0, max(0.0, (x - kiss) / (closed - kiss)))


def capacity(case, x, omega, theta):
    xi = normalised(case, x, theta)
    if xi <= XI_0:
        return 0.0
    return 2 * radius(abs(omega), theta) * np.polyval([BETA[2], BETA[1], BETA[0], 0.0], xi)


def resistance(omega, t_load):
    return B_C * omega + T_L0 * np.tanh(omega / OMEGA_L) + K_L * omega * abs(omega) + t_load


def holding(omega, t_e, t_load):
    return (J_C * (t_e - B_F * omega) + J_F * resistance(omega, t_load)) / (J_F + J_C)


def rates(case, u, direction, y):
    """Rates of the states omega_f, omega_c, theta_c, theta_b, E_d.  direction 0 means locked."""
    omega_f, omega_c, theta_c, theta_b, _ = y
    _, x, t_e, theta_h, t_load = u
    if direction == 0:
        common = (t_e - B_F * omega_f - resistance(omega_f, t_load)) / (J_F + J_C)
        d_f = d_c = common
        power = 0.0
    else:
        t_fc = direction * capacity(case, x, omega_f - omega_c, theta_c)
        d_f = (t_e - B_F * omega_f - t_fc) / J_F
        d_c = (t_fc - resistance(omega_c, t_load)) / J_C
        power = t_fc * (omega_f - omega_c)
    if normalised(case, x, theta_c) > XI_0:
        d_tc = (GAMMA_1 * (theta_b - theta_c) + GAMMA_3 * power) / C_1
        d_tb = (-GAMMA_1 * (theta_b - theta_c) + GAMMA_2 * (theta_h - theta_b) + (1 - GAMMA_3) * power) / C_B
    else:
        d_tc = GAMMA_2 * (theta_h - theta_c) / C_1
        d_tb = 2 * GAMMA_2 * (theta_h - theta_b) / C_B
    return [d_f, d_c, d_tc, d_tb, power]


def excess(case, u, direction, y):
    """Event function, which changes from negative to positive at the event that ends this motion."""
    if direction == 0:
        return abs(holding(y[0], u[2], u[4])) - capacity(case, u[1], 0.0, y[2])
    return -direction * (y[0] - y[1])


def after_event(case, u, y):
    """Motion after both sides have reached one speed: locked if the clutch can hold, otherwise slip in the direction of the torque."""
    hold = holding(y[0], u[2], u[4])
    if abs(hold) <= capacity(case, u[1], 0.0, y[2]):
        return 0
    return 1 if hold > 0 else -1


def segment(case, u, direction, t, end, y, events):
    while t < end:
        if direction == 0 and excess(case, u, 0, y) > 0:
            direction = after_event(case, u, y)
            events.append(dict(time=t, what="break-away"))
        sol = solve_ivp(lambda _, z: rates(case, u, direction, z), (t, end), y, method="DOP853", rtol=1e-13, atol=1e-13, dense_output=True, max_step=0.01)
        grid = np.unique(np.concatenate([sol.t, np.linspace(t, end, 400)]))
        values = [excess(case, u, direction, sol.sol(s)) for s in grid]
        hit = next((k for k in range(1, len(grid)) if values[k] > 0 and grid[k] > t + 1e-9), None)
        if hit is None:
            return direction, sol.y[:, -1]
        # Just after a break-away the slip grows from zero, so only a sign change from a negative value counts.
        low = grid[hit - 1] if values[hit - 1] <= 0 else t
        t = brentq(lambda s: excess(case, u, direction, sol.sol(s)), low, grid[hit], xtol=1e-15)
        y = sol.sol(t)
        if direction == 0:
            direction = 1 if holding(y[0], u[2], u[4]) > 0 else -1
            events.append(dict(time=t, what="break-away"))
        else:
            y[0] = y[1] = (J_F * y[0] + J_C * y[1]) / (J_F + J_C)
            direction = after_event(case, u, y)
            events.append(dict(time=t, what="lock-up" if direction == 0 else "reversal"))
    return direction, y


def solve(case):
    y = np.array([*case["start"], 0.0])
    direction = int(np.sign(y[0] - y[1]))
    stops = sorted({*case["look"], *(u[0] for u in case["inputs"])})
    rows, events, t = [], [], 0.0
    for stop in stops:
        if stop > t:
            u = [u for u in case["inputs"] if u[0] <= t + 1e-12][-1]
            direction, y = segment(case, u, direction, t, stop, y, events)
            t = stop
        if stop in case["look"]:
            rows.append(dict(time=t, omega_f=y[0], omega_c=y[1], theta_c=y[2], theta_b=y[3], e_d=y[4], stuck=direction == 0))
    return dict(start=case["start"], x_cnt=case["x_cnt"], x_cls=case["x_cls"], inputs=case["inputs"], events=events, rows=rows)


if __name__ == "__main__":
    result = {name: solve(case) for name, case in SCENARIOS.items()}
    target = pathlib.Path(__file__).with_suffix(".json")
    target.write_text(json.dumps(result, indent=1) + "\n")
    for name, found in result.items():
        print(name, [(e["what"], round(e["time"], 6)) for e in found["events"]], found["rows"][-1])
