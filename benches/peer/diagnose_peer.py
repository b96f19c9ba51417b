"""The fits of a diagnosis as an engineer scripts them: numba for the plant, scipy for the least squares.

    python benches/peer/diagnose_peer.py CAMPAIGN [--processes 2] [--json]

Fits the nominal plant and each of the 24 candidates to all recordings but the held-out one: corrected replays with the same memory,
Huber's loss, tolerances and start temperatures as priors, Runge-Kutta of fourth order with a substep of 10 ms. Effects are in simple
form (lags of first order, signal delays by interpolation), each fitted from its first start only; there is no screening and no search for
pairs. Prints the seconds of the fits, compilation excluded, and the candidates by cost.
"""

import argparse
import json
import time
from math import exp, sqrt, tanh
from multiprocessing import Pool
from pathlib import Path

import numpy as np
from numba import njit
from scipy.optimize import least_squares

HORIZON_S, HUBER = 0.25, 5.0

# Places in the array of plant numbers.
NAMES = (
    "R_1 R_2 mu_0 alpha_1 alpha_2 m_0 m_1 m_2 x_cnt x_cls beta_1 beta_2 beta_3 C_1 C_b gamma_1 gamma_2 gamma_3 "
    "J_f J_c b_f b_c T_L0 omega_L k_L mgR "
    "bias gain engine_tau act_tau act_delay play inv_speed kiss closed_share kiss_slope cushion_slope hyst_width hyst_stroke "
    "mu_factor fade_depth fade_onset fade_width grad_amp grad_speed drag drag_visc jud_cos jud_sin jud_order "
    "share body_factor air_factor compliance disc_share damping grade mass c_delay c_gain f_delay"
).split()
AT = {name: k for k, name in enumerate(NAMES)}
(R_1, R_2, MU_0, ALPHA_1, ALPHA_2, M_0, M_1, M_2, X_CNT, X_CLS, BETA_1, BETA_2, BETA_3, C_1, C_B, GAMMA_1, GAMMA_2, GAMMA_3,
 J_F, J_C, B_F, B_C, T_L0, OMEGA_L, K_L, MGR,
 BIAS, GAIN, ENGINE_TAU, ACT_TAU, ACT_DELAY, PLAY, INV_SPEED, KISS, CLOSED_SHARE, KISS_SLOPE, CUSHION_SLOPE, HYST_WIDTH, HYST_STROKE,
 MU_FACTOR, FADE_DEPTH, FADE_ONSET, FADE_WIDTH, GRAD_AMP, GRAD_SPEED, DRAG, DRAG_VISC, JUD_COS, JUD_SIN, JUD_ORDER,
 SHARE, BODY_FACTOR, AIR_FACTOR, COMPLIANCE, DISC_SHARE, DAMPING, GRADE, MASS, C_DELAY, C_GAIN, F_DELAY) = range(len(NAMES))

NULL = dict(
    bias=0, gain=1, engine_tau=0, act_tau=0, act_delay=0, play=0, inv_speed=0, kiss=0, closed_share=0, kiss_slope=0, cushion_slope=0,
    hyst_width=0, hyst_stroke=0.2, mu_factor=1, fade_depth=0, fade_onset=150, fade_width=30, grad_amp=0, grad_speed=50, drag=0, drag_visc=0,
    jud_cos=0, jud_sin=0, jud_order=1, share=0, body_factor=1, air_factor=1, compliance=0, disc_share=0.1, damping=1, grade=0, mass=1,
    c_delay=0, c_gain=1, f_delay=0,
)

# Candidate: parameter -> (start, scale, least, most).
CANDIDATES = {
    "engine_torque_bias": {"bias": (2, 2, -50, 50)},
    "engine_torque_gain": {"gain": (1.05, 0.05, 0.2, 2)},
    "engine_torque_lag": {"engine_tau": (0.05, 0.05, 0, 1)},
    "actuator_lag": {"act_tau": (0.03, 0.03, 0, 1)},
    "actuator_delay": {"act_delay": (0.03, 0.03, 0, 0.3)},
    "actuator_backlash": {"play": (0.1, 0.1, 0, 2)},
    "actuator_rate_limit": {"inv_speed": (0.1, 0.1, 0, 1)},
    "kiss_point_offset": {"kiss": (0.1, 0.1, -2, 2), "closed_share": (0.5, 0.5, -1, 2)},
    "kiss_point_thermal": {"kiss_slope": (0.002, 0.002, -0.02, 0.02), "closed_share": (0.5, 0.5, -1, 2)},
    "cushion_stiffness_thermal": {"cushion_slope": (-0.001, 0.001, -0.01, 0.01)},
    "cushion_hysteresis": {"hyst_width": (0.1, 0.1, -1, 1), "hyst_stroke": (0.2, 0.1, 0.02, 2)},
    "friction_level": {"mu_factor": (0.9, 0.1, 0.2, 2)},
    "friction_fade": {"fade_depth": (0.2, 0.1, -0.9, 0.9), "fade_onset": (110, 20, 30, 300), "fade_width": (30, 15, 2, 200)},
    "friction_slip_gradient": {"grad_amp": (0.08, 0.08, -0.5, 0.5), "grad_speed": (12, 12, 1, 200)},
    "clutch_drag": {"drag": (2, 2, -20, 50), "drag_visc": (0.01, 0.01, -0.1, 0.5)},
    "judder": {"jud_cos": (0.05, 0.05, -0.9, 0.9), "jud_sin": (0.05, 0.05, -0.9, 0.9), "jud_order": (1, 0.2, 0.1, 20)},
    "heat_partition": {"share": (0.1, 0.1, -0.5, 0.5)},
    "clutch_cooling": {"body_factor": (1.5, 0.5, 0, 10), "air_factor": (1.5, 0.5, 0, 10)},
    "driveline_compliance": {"compliance": (0.002, 0.001, 0.0003, 0.1), "damping": (1, 0.5, 0.05, 20)},
    "road_load": {"grade": (0.02, 0.02, -1, 1)},
    "vehicle_mass": {"mass": (1.1, 0.1, 0.2, 3)},
    "clutch_speed_delay": {"c_delay": (0.02, 0.01, 0, 0.3)},
    "clutch_speed_gain": {"c_gain": (1.02, 0.01, 0.5, 1.5)},
    "engine_speed_delay": {"f_delay": (0.02, 0.01, 0, 0.3)},
}

TOLERANCES = {
    "friction.mu": ["mu_0", "alpha_1", "m_0", "m_1", "m_2"],
    "cushion_spring.beta": ["beta_1", "beta_2", "beta_3"],
    "actuator.x_cnt": ["x_cnt"],
    "actuator.x_cls": ["x_cls"],
    "engine.T_e_bias": ["bias"],
    "engine.T_e_gain": ["gain"],
}


@njit(cache=True)
def contact_point(v):
    disc = v[BETA_2] ** 2 - 4 * v[BETA_1] * v[BETA_3]
    root = (-v[BETA_2] + sqrt(disc)) / (2 * v[BETA_3]) if disc >= 0 else 0.0
    return root if 0 < root < 1 else 0.0


@njit(cache=True)
def position(v, x, theta):
    shift = v[KISS] + v[KISS_SLOPE] * (theta - 25)
    cnt, cls = v[X_CNT] + shift, v[X_CLS] + v[CLOSED_SHARE] * shift
    return min(max((x - cnt) / (cls - cnt), 0.0), 1.0)


@njit(cache=True)
def capacity(v, xi_0, x, branch, slip, theta, angle):
    xi = position(v, x, theta)
    if xi <= xi_0:
        return 0.0
    force = max(xi * (v[BETA_1] + xi * (v[BETA_2] + xi * v[BETA_3])), 0.0)
    force *= (1 + 0.5 * v[HYST_WIDTH] * branch) * max(1 + v[CUSHION_SLOPE] * (theta - 25), 0.0)
    mean, half = 0.5 * (v[R_1] + v[R_2]), 0.5 * (v[R_2] - v[R_1])
    mu_d = v[M_0] + theta * (v[M_1] + theta * v[M_2])
    if slip == 0.0:
        radius = max(v[MU_0], 0.02) * mean
    else:
        radius = 0.0
        for node, weight in (
            (-0.8611363115940526, 0.34785484513745385), (-0.33998104358485626, 0.6521451548625461),
            (0.33998104358485626, 0.6521451548625461), (0.8611363115940526, 0.34785484513745385),
        ):
            rho = mean + half * node
            w = slip * rho / mean
            radius += 0.5 * weight * rho * max(mu_d + (v[MU_0] - mu_d + v[ALPHA_1] * w) * exp(-v[ALPHA_2] * w), 0.02)
    torque = 2 * radius * force * v[MU_FACTOR]
    if v[GRAD_AMP] != 0.0:
        torque += 2 * mean * force * v[GRAD_AMP] * exp(-((slip / v[GRAD_SPEED]) ** 2))
    if v[FADE_DEPTH] != 0.0:
        torque *= 1 - v[FADE_DEPTH] / (1 + exp(-4 * (theta - v[FADE_ONSET]) / v[FADE_WIDTH]))
    if v[JUD_COS] != 0.0 or v[JUD_SIN] != 0.0:
        torque *= 1 + v[JUD_COS] * np.cos(v[JUD_ORDER] * angle) + v[JUD_SIN] * np.sin(v[JUD_ORDER] * angle)
    return max(torque, 0.0)


@njit(cache=True)
def load(v, w):
    grade = v[MGR] * v[GRADE] / sqrt(1 + v[GRADE] ** 2)
    return v[B_C] * w + v[T_L0] * tanh(w / v[OMEGA_L]) + v[K_L] * w * abs(w) + grade


@njit(cache=True)
def rates(v, y, dy, xi_0, stuck, direction, x, branch, t_e, theta_h):
    """States: flywheel, disc, vehicle, twist, disc and body temperature, slip angle."""
    total = v[J_C] * v[MASS]
    soft = v[COMPLIANCE] > 0
    j = total * v[DISC_SHARE] if soft else total
    resist = y[3] / v[COMPLIANCE] + v[DAMPING] * (y[1] - y[2]) if soft else load(v, y[1])
    drive = t_e - v[B_F] * y[0]
    slip = y[0] - y[1]
    if stuck:
        dy[0] = dy[1] = (drive - resist) / (v[J_F] + j)
        power = 0.0
        slip = 0.0
    else:
        torque = direction * capacity(v, xi_0, x, branch, max(direction * slip, 0.0), y[4], y[6])
        torque += v[DRAG] * tanh(slip / 2) + v[DRAG_VISC] * slip
        dy[0] = (drive - torque) / v[J_F]
        dy[1] = (torque - resist) / j
        power = torque * slip
    dy[2] = (resist - load(v, y[2])) / (total - j) if soft else dy[1]
    dy[3] = y[1] - y[2] if soft else 0.0
    g1, g2, g3 = v[GAMMA_1] * v[BODY_FACTOR], v[GAMMA_2] * v[AIR_FACTOR], v[GAMMA_3] + v[SHARE]
    if position(v, x, y[4]) > xi_0:
        dy[4] = (g1 * (y[5] - y[4]) + g3 * power) / v[C_1]
        dy[5] = (g1 * (y[4] - y[5]) + g2 * (theta_h - y[5]) + (1 - g3) * power) / v[C_B]
    else:
        dy[4] = (g2 * (theta_h - y[4]) + g3 * power) / v[C_1]
        dy[5] = (2 * g2 * (theta_h - y[5]) + (1 - g3) * power) / v[C_B]
    dy[6] = slip


@njit(cache=True)
def runge_kutta(v, y, xi_0, stuck, direction, x, branch, t_e, theta_h, h):
    k1, k2, k3, k4 = np.empty(7), np.empty(7), np.empty(7), np.empty(7)
    rates(v, y, k1, xi_0, stuck, direction, x, branch, t_e, theta_h)
    rates(v, y + 0.5 * h * k1, k2, xi_0, stuck, direction, x, branch, t_e, theta_h)
    rates(v, y + 0.5 * h * k2, k3, xi_0, stuck, direction, x, branch, t_e, theta_h)
    rates(v, y + h * k3, k4, xi_0, stuck, direction, x, branch, t_e, theta_h)
    return y + h / 6 * (k1 + 2 * (k2 + k3) + k4)


@njit(cache=True)
def can_hold(v, y, xi_0, x, branch, t_e):
    total = v[J_C] * v[MASS]
    soft = v[COMPLIANCE] > 0
    j = total * v[DISC_SHARE] if soft else total
    resist = y[3] / v[COMPLIANCE] + v[DAMPING] * (y[1] - y[2]) if soft else load(v, y[1])
    hold = (j * (t_e - v[B_F] * y[0]) + v[J_F] * resist) / (v[J_F] + j)
    most = capacity(v, xi_0, x, branch, 0.0, y[4], y[6])
    return abs(hold) <= most and most > 0, hold


@njit(cache=True)
def late(history, n, delay, dt):
    back = n - delay / dt
    if back <= 0:
        return history[0]
    k = int(back)
    return history[k] if k >= n else history[k] + (back - k) * (history[k + 1] - history[k])


@njit(cache=True)
def replay(v, dt, x_cmd, t_rep, theta_h, measured_f, measured_c, theta_c0, theta_b0, locked_slip, horizon):
    """Predicted speeds of a replay that is corrected towards the measured ones."""
    n = len(x_cmd)
    out = np.empty((2, n))
    xi_0 = contact_point(v)
    y = np.zeros(7)
    y[0], y[1] = measured_f[0], measured_c[0] / v[C_GAIN]
    if x_cmd[0] > 0.5 * (v[X_CNT] + v[X_CLS]) and abs(y[0] - y[1]) < locked_slip:
        y[0] = y[1] = 0.5 * (y[0] + y[1])
    y[2], y[4], y[5] = y[1], theta_c0, theta_b0
    t_e, x, branch = v[GAIN] * t_rep[0] + v[BIAS], x_cmd[0], 0.0
    slip = y[0] - y[1]
    stuck, hold = can_hold(v, y, xi_0, x, branch, t_e)
    stuck = stuck and slip == 0.0
    direction = -1.0 if slip < 0 or (slip == 0.0 and hold < 0) else 1.0
    share = 1 - exp(-dt / horizon)
    total = v[J_C] * v[MASS]
    j = total * v[DISC_SHARE] if v[COMPLIANCE] > 0 else total
    history_f, history_c = np.empty(n + 1), np.empty(n + 1)
    longest = 1e-2
    if v[COMPLIANCE] > 0:
        inertia = j * (total - j) / total
        longest = min(longest, 0.5 / max(sqrt(1 / (v[COMPLIANCE] * inertia)), v[DAMPING] / inertia))
    for k in range(n):
        history_f[k], history_c[k] = y[0], y[1]
        out[0, k] = late(history_f, k, v[F_DELAY], dt)
        out[1, k] = v[C_GAIN] * late(history_c, k, v[C_DELAY], dt)
        e_f, e_c = share * (measured_f[k] - out[0, k]), share * (measured_c[k] - out[1, k]) / v[C_GAIN]
        if stuck:
            common = (v[J_F] * e_f + total * e_c) / (v[J_F] + total)
            e_f = e_c = common
        y[0] += e_f
        y[1] += e_c
        y[2] += e_c
        if not stuck and y[0] != y[1]:
            direction = 1.0 if y[0] > y[1] else -1.0
        # Command: delay, rate limit, lag and play, in this order.
        back = k - v[ACT_DELAY] / dt
        low = max(int(np.floor(back)), 0)
        wanted = x_cmd[low] + (max(back, 0.0) - low) * (x_cmd[min(low + 1, k)] - x_cmd[low])
        target = wanted
        if v[INV_SPEED] > 0:
            most = dt / v[INV_SPEED]
            target = x + min(max(wanted - x, -most), most)
        if v[ACT_TAU] > 0:
            target = x + (target - x) * (1 - exp(-dt / v[ACT_TAU]))
        if v[PLAY] > 0:
            target = min(max(x, target - 0.5 * v[PLAY]), target + 0.5 * v[PLAY])
        if v[HYST_WIDTH] != 0.0 and target != x:
            goal = 1.0 if target > x else -1.0
            branch = goal + (branch - goal) * exp(-2 * abs(target - x) / v[HYST_STROKE])
        x = target
        asked = v[GAIN] * t_rep[k] + v[BIAS]
        t_e = t_e + (asked - t_e) * (1 - exp(-dt / v[ENGINE_TAU])) if v[ENGINE_TAU] > 0 else asked
        count = int(np.ceil(dt / longest * (1 - 1e-9)))
        for _ in range(count):
            left = dt / count
            for _ in range(8):
                if stuck:
                    holds, hold = can_hold(v, y, xi_0, x, branch, t_e)
                    if not holds:
                        stuck, direction = False, (-1.0 if hold < 0 else 1.0)
                trial = runge_kutta(v, y, xi_0, stuck, direction, x, branch, t_e, theta_h[k], left)
                if stuck or direction * (trial[0] - trial[1]) >= 0:
                    y = trial
                    break
                low_h, high_h = 0.0, left
                for _ in range(40):
                    middle = 0.5 * (low_h + high_h)
                    trial = runge_kutta(v, y, xi_0, False, direction, x, branch, t_e, theta_h[k], middle)
                    if direction * (trial[0] - trial[1]) < 0:
                        high_h = middle
                    else:
                        low_h = middle
                    if high_h - low_h < 1e-9:
                        break
                y = runge_kutta(v, y, xi_0, False, direction, x, branch, t_e, theta_h[k], high_h)
                y[0] = y[1] = (v[J_F] * y[0] + j * y[1]) / (v[J_F] + j)
                stuck, hold = can_hold(v, y, xi_0, x, branch, t_e)
                if not stuck:
                    direction = -1.0 if hold < 0 else 1.0
                left -= high_h
                if left <= 0:
                    break
            if v[COMPLIANCE] == 0:
                y[2] = y[1]
    return out


def noise(signal):
    return max(np.median(np.abs(np.diff(signal, 3))) / 0.6745 / sqrt(20), 0.01)


class Campaign:
    """Recordings but the held-out one, the nominal numbers, and the tolerances."""

    def __init__(self, folder):
        vehicle = json.loads((folder / "vehicle.json").read_text())
        flat = {}
        for group in ("friction", "thermal", "driveline"):
            flat.update({k: v for k, v in vehicle[group].items() if not isinstance(v, list)})
        flat.update(zip(("m_0", "m_1", "m_2"), vehicle["friction"]["mu_d"]))
        flat.update(zip(("beta_1", "beta_2", "beta_3"), vehicle["cushion_spring"]["beta"]))
        flat |= {"x_cnt": vehicle["actuator"]["x_cnt"][0], "x_cls": vehicle["actuator"]["x_cls"][0], "mgR": flat["mgR_over_i"]} | NULL
        self.nominal = np.array([float(flat[name]) for name in NAMES])
        self.tolerances = []
        for name, size in sorted(vehicle.get("tolerance", {}).items()):
            places = [AT[n] for n in TOLERANCES.get(name, [name.split(".")[1]])]
            self.tolerances.append((places, size.get("abs"), size.get("rel")))
        index = json.loads((folder / "recordings.json").read_text())
        launches = sorted((r for r in index if index[r]["manoeuvre"] == "launch"), key=lambda r: (index[r]["theta_c0_degC"], r))
        held_out = launches[len(launches) // 2] if len(launches) > 2 else sorted(index)[-1]
        self.recordings = []
        for name in sorted(index):
            if name != held_out:
                data = np.genfromtxt(folder / f"{name}.csv", delimiter=",", names=True)
                columns = [np.ascontiguousarray(data[c]) for c in ("x_to_cmd_mm", "T_e_Nm", "theta_h_degC", "omega_f_rad_s", "omega_c_rad_s")]
                theta = index[name]["theta_c0_degC"], index[name]["theta_b0_degC"]
                self.recordings.append((data["time_s"][1], columns, theta, noise(columns[3]), noise(columns[4])))

    def plant(self, z, effect):
        v = self.nominal.copy()
        for place, value in effect:
            v[place] = value
        for (places, absolute, relative), z_k in zip(self.tolerances, z):
            for place in places:
                v[place] = v[place] + absolute * z_k if absolute else v[place] * (1 + relative * z_k)
        return v

    def residuals(self, p, places):
        n, m = len(self.tolerances), 2 * len(self.recordings)
        v = self.plant(p[:n], list(zip(places, p[n + m :])))
        shifts = p[n : n + m].reshape(-1, 2)
        parts = [p[: n + m]]
        for (dt, columns, theta, noise_f, noise_c), shift in zip(self.recordings, shifts):
            out = replay(v, dt, *columns, theta[0] + shift[0], theta[1] + shift[1], max(0.6, 6 * noise_f), HORIZON_S)
            parts += [(columns[3] - out[0]) / noise_f, (columns[4] - out[1]) / noise_c]
        return np.concatenate(parts)

    def fit(self, effect):
        """Cost of the nominal plant with this candidate fitted from its start."""
        parameters = CANDIDATES.get(effect, {})
        places = [AT[name] for name in parameters]
        free = len(self.tolerances) + 2 * len(self.recordings)
        start, scale, low, high = ([q[k] for q in parameters.values()] for k in range(4))
        fitted = least_squares(
            self.residuals, np.concatenate([np.zeros(free), start]), args=(places,), loss="huber", f_scale=HUBER,
            x_scale=np.concatenate([np.ones(free), scale]), bounds=([-np.inf] * free + low, [np.inf] * free + high),
            diff_step=1e-4, ftol=1e-4, max_nfev=20,
        )
        return effect, 2 * fitted.cost, fitted.nfev


def work(task):
    folder, effect = task
    if folder not in work.campaigns:
        work.campaigns[folder] = Campaign(folder)
    return work.campaigns[folder].fit(effect)


work.campaigns = {}


def warm_up(folder):
    """Compiles, or loads what another process has compiled."""
    campaign = Campaign(folder)
    campaign.residuals(np.zeros(len(campaign.tolerances) + 2 * len(campaign.recordings)), [])


def main():
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("campaign", type=Path)
    parser.add_argument("--processes", type=int, default=2)
    parser.add_argument("--json", action="store_true")
    args = parser.parse_args()
    warm_up(args.campaign)
    with Pool(args.processes, initializer=warm_up, initargs=(args.campaign,)) as pool:
        pool.map(time.sleep, [0.5] * args.processes)
        start = time.perf_counter()
        fits = list(pool.imap_unordered(work, [(args.campaign, effect) for effect in ["nominal", *CANDIDATES]]))
        seconds = time.perf_counter() - start
    fits.sort(key=lambda f: f[1])
    if args.json:
        print(json.dumps({"seconds": seconds, "fits": [{"effect": e, "cost": c, "evaluations": n} for e, c, n in fits]}))
        return
    for effect, cost, evaluations in fits:
        print(f"{effect:<28} cost {cost:12.1f}  {evaluations} steps")
    print(f"{len(fits)} fits in {seconds:.1f} s with {args.processes} processes")


if __name__ == "__main__":
    main()
