"""The nominal plant by hand in Python, as an FMU by pythonfmu: the yardstick of benches/pythonfmu.py. The scheme is that of plant.c beside it."""

from math import exp, fabs, sqrt, tanh

from pythonfmu import Fmi2Causality, Fmi2Slave, Real

R_1, R_2, MU_0, ALPHA_1, ALPHA_2 = 0.074, 0.108, 0.15, 0.02, 0.3
M_0, M_1, M_2 = 0.1834, 0.0024, -7.06e-06
X_CNT, X_CLS = 4.02, 7.78
BETA = (26.1195, -1304.6, 5818.5)
XI_0 = -0.5 * (BETA[1] - sqrt(BETA[1] * BETA[1] - 4.0 * BETA[0] * BETA[2])) / BETA[2]
C_1, C_B, GAMMA_1, GAMMA_2, GAMMA_3 = 70.0, 6928.0, 14.58, 25.0, 0.5
J_F, J_C, B_F, B_C, T_L0, OMEGA_L, K_L = 0.189, 0.578, 0.03, 0.012, 3.1, 0.5, 2e-05
GAUSS = (
    (-0.8611363115940526, 0.34785484513745385),
    (-0.33998104358485626, 0.6521451548625461),
    (0.33998104358485626, 0.6521451548625461),
    (0.8611363115940526, 0.34785484513745385),
)
MEAN, HALF = 0.5 * (R_1 + R_2), 0.5 * (R_2 - R_1)
SUBSTEP = 1e-3


def coefficient(w, mu_d):
    return max(mu_d + (MU_0 - mu_d + ALPHA_1 * w) * exp(-ALPHA_2 * w), 0.02)


def radius(w, theta):
    mu_d = M_0 + theta * (M_1 + theta * M_2)
    if w == 0.0:
        return coefficient(0.0, mu_d) * MEAN
    total = 0.0
    for node, weight in GAUSS:
        rho = MEAN + HALF * node
        total += weight * coefficient(w / MEAN * rho, mu_d) * rho
    return 0.5 * total


def normalised(x):
    return min(max((x - X_CNT) / (X_CLS - X_CNT), 0.0), 1.0)


def capacity(x, w, theta):
    xi = normalised(x)
    if xi <= XI_0:
        return 0.0
    force = xi * (BETA[0] + xi * (BETA[1] + xi * BETA[2]))
    return 2.0 * radius(w, theta) * force if force > 0.0 else 0.0


def resistance(w, t_load):
    return B_C * w + T_L0 * tanh(w / OMEGA_L) + K_L * w * fabs(w) + t_load


def holding(w, t_e, resist):
    return (J_C * (t_e - B_F * w) + J_F * resist) / (J_F + J_C)


class PeerPlant(Fmi2Slave):
    author = "Kisspoint"
    description = "The nominal plant of benches/peer/plant.c"

    def __init__(self, **kwargs):
        super().__init__(**kwargs)
        self.x_to, self.T_e_ref, self.theta_h, self.T_load = 0.0, 0.0, 25.0, 0.0
        self.omega_f, self.omega_c, self.theta_c, self.E_d = 104.71975511965978, 0.0, 25.0, 0.0
        for name in ("x_to", "T_e_ref", "theta_h", "T_load"):
            self.register_variable(Real(name, causality=Fmi2Causality.input))
        for name in ("omega_f", "omega_c", "theta_c", "E_d"):
            self.register_variable(Real(name, causality=Fmi2Causality.output))
        # omega_f, omega_c, theta_c, theta_b, slip angle, e_d, work in, losses
        self.y = [self.omega_f, 0.0, 25.0, 25.0, 0.0, 0.0, 0.0, 0.0]
        self.stuck, self.direction = False, 1.0

    def rates(self, y, engaged):
        resist = resistance(y[1], self.T_load)
        if self.stuck:
            t_fc = holding(y[0], self.T_e_ref, resist)
            d_f = d_c = (self.T_e_ref - B_F * y[0] - t_fc) / J_F
            slip = 0.0
        else:
            slip = y[0] - y[1]
            t_fc = self.direction * capacity(self.x_to, max(self.direction * slip, 0.0), y[2])
            d_f = (self.T_e_ref - B_F * y[0] - t_fc) / J_F
            d_c = (t_fc - resist) / J_C
        power = t_fc * slip
        if engaged:
            exchange = GAMMA_1 * (y[3] - y[2])
            d_disc = (exchange + GAMMA_3 * power) / C_1
            d_body = (-exchange + GAMMA_2 * (self.theta_h - y[3]) + (1.0 - GAMMA_3) * power) / C_B
        else:
            d_disc = GAMMA_2 * (self.theta_h - y[2]) / C_1
            d_body = 2.0 * GAMMA_2 * (self.theta_h - y[3]) / C_B
        return (d_f, d_c, d_disc, d_body, slip, power, self.T_e_ref * y[0], B_F * y[0] * y[0] + resist * y[1])

    def runge_kutta(self, engaged, h):
        y = self.y
        k1 = self.rates(y, engaged)
        k2 = self.rates([a + 0.5 * h * k for a, k in zip(y, k1)], engaged)
        k3 = self.rates([a + 0.5 * h * k for a, k in zip(y, k2)], engaged)
        k4 = self.rates([a + h * k for a, k in zip(y, k3)], engaged)
        end = [a + h / 6.0 * (p + 2.0 * (q + r) + s) for a, p, q, r, s in zip(y, k1, k2, k3, k4)]
        if self.stuck:
            end[1] = end[0]
        return end

    def passed(self, y):
        """Positive once the event that ends this motion has happened."""
        if not self.stuck:
            return -self.direction * (y[0] - y[1])
        return fabs(self.hold(y)) - capacity(self.x_to, 0.0, y[2])

    def hold(self, y):
        return holding(y[0], self.T_e_ref, resistance(y[1], self.T_load))

    def break_away(self):
        self.direction = -1.0 if self.hold(self.y) < 0.0 else 1.0
        self.stuck = False

    def meet(self):
        self.y[0] = self.y[1] = (J_F * self.y[0] + J_C * self.y[1]) / (J_F + J_C)
        hold, most = self.hold(self.y), capacity(self.x_to, 0.0, self.y[2])
        self.stuck = fabs(hold) <= most and most > 0.0
        if not self.stuck:
            self.direction = -1.0 if hold < 0.0 else 1.0

    def locate(self, engaged, end, high):
        """Length of the piece up to the event, and the state there: regula falsi in the Illinois form."""
        low, at_low, at_high = 0.0, min(self.passed(self.y), 0.0), self.passed(end)
        for _ in range(60):
            if high - low <= 4e-16 * high:
                break
            middle = high - at_high * (high - low) / (at_high - at_low)
            if not low < middle < high:
                middle = 0.5 * (low + high)
            trial = self.runge_kutta(engaged, middle)
            value = self.passed(trial)
            if value > 0.0:
                at_low *= 0.5
                high, at_high, end = middle, value, trial
                if value < 1e-12:
                    break
            else:
                at_high *= 0.5
                low, at_low = middle, value
        return high, end

    def substep(self, left):
        for events in range(9):
            if self.stuck and self.passed(self.y) > 0.0:
                self.break_away()
            engaged = normalised(self.x_to) > XI_0
            end = self.runge_kutta(engaged, left)
            if self.passed(end) <= 0.0 or events == 8:
                self.y = end
                return
            length, self.y = self.locate(engaged, end, left)
            left -= length
            self.break_away() if self.stuck else self.meet()
            if left <= 1e-12:
                return

    def do_step(self, current_time, step_size):
        count = max(1, round(step_size / SUBSTEP))
        for _ in range(count):
            self.substep(step_size / count)
        self.omega_f, self.omega_c, self.theta_c, self.E_d = self.y[0], self.y[1], self.y[2], self.y[5]
        return True
