/* The controller by hand in C: the yardstick of benches/step.rs. Same scheme as the Rust controller with its default settings: guard of
 * the inputs, exact observer and thermal model, and the governed law with its lags, load observer, inertia, approach, landing and learning;
 * without the hill holder, which a level road leaves alone.
 * Prints nanoseconds per step (median of batches) and final outputs. */
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <time.h>

#define STEPS 1100
#define LAUNCHES 200

typedef struct {
  double omega_f, omega_c, t_e, theta_h;
  int engage;
} Inputs;

typedef struct {
  double phi[2][2], gamma[2][2];
} Held;

typedef struct {
  int mode, observing, phase, started, believed, fault;
  double elapsed, duration, c0, f0, end, slope;
  double i_engine, i_clutch, i_torque, omega_hat, t_hat, theta_c, theta_b, last_slip;
  Inputs good;
  double last[2], bad_for, agree_for, unchanged_for;
  double x_to, t_e_ref, t_c_ref, x_fb, e_d, last_c;
  double load_w, load_t, inertia[5], speed[2], slip[2], wanted[4], carried[4], expected[3], lacking;
  double hold_back, near_for, closing_for, landing_for, bitten_for, engaged_for, from, follows, k_map;
  double land_slip, land_torque, takes_over;
  double touch, friction, learn_t[3], learn_k[3], sums[5];
} State;

/* Vehicle and the default settings. */
static double R_1 = 0.074, R_2 = 0.108, mu_0 = 0.15, alpha_1 = 0.02, alpha_2 = 0.3, m_0 = 0.1834, m_1 = 0.0024, m_2 = -7.06e-06;
static double x_cnt[3] = {4.02, 0, 0}, x_cls[3] = {7.78, 0, 0}, beta[3] = {26.1195, -1304.6, 5818.5}, xi_0;
static double C_1 = 70.0, C_b = 6928.0, gamma_1 = 14.58, gamma_2 = 25.0, gamma_3 = 0.5, J_f = 0.189, J_c = 0.578, b_f = 0.03;
static double b_c = 0.012, T_L0 = 3.1, w_L = 0.5, k_L = 2e-5;
static double t_r = 1.3, w_end = 111.0, end_slope = 20.0, least_share = 0.3, idle = 104.71975511965978;
static double kpf = 1.2, kif = 2.0, kpc = 1.2, l_1 = 300.0, l_2 = -4252.0;
static double actuator_time = 0.045, filter_time = 0.05, load_band = 3.0, torque_band = 1.5, droop = 15.0, kp_droop = 1.5, ki_droop = 6.0;
static double reserve = 8.0, lock_time = 0.04, landing_time = 1.5, closing_rate = 150.0;
static double slip_lock = 1.5, slip_release = 5.0, t_max = 180.0, te_min = -30.0, te_max = 180.0, x_open = 0.0, x_max = 9.0;
static double rate_open = 60.0, rate_close = 200.0, fb_max = 1.5, stall = 50.0, stall_margin = 20.0;
static double hold = 0.05, recover = 0.1, freeze = 0.2, jump = 20.0, acceleration = 3000.0;
static Held observer, engaged_system, open_system;

static void product(double a[2][2], double b[2][2], double out[2][2]) {
  double r[2][2];
  for (int i = 0; i < 2; i++)
    for (int j = 0; j < 2; j++) r[i][j] = a[i][0] * b[0][j] + a[i][1] * b[1][j];
  for (int i = 0; i < 2; i++)
    for (int j = 0; j < 2; j++) out[i][j] = r[i][j];
}

static Held transition(double a00, double a01, double a10, double a11, double h) {
  int doublings = 12;
  double f = h / (1 << doublings), m[2][2] = {{a00 * f, a01 * f}, {a10 * f, a11 * f}}, p[2][2] = {{1, 0}, {0, 1}}, e[2][2], s[2][2];
  for (int k = 13; k >= 2; k--) {
    product(m, p, p);
    for (int i = 0; i < 2; i++)
      for (int j = 0; j < 2; j++) p[i][j] = p[i][j] / k + (i == j);
  }
  product(m, p, e);
  e[0][0] += 1;
  e[1][1] += 1;
  for (int d = 0; d < doublings; d++) {
    for (int i = 0; i < 2; i++)
      for (int j = 0; j < 2; j++) s[i][j] = 0.5 * (e[i][j] + (i == j));
    product(s, p, p);
    product(e, e, e);
  }
  Held held;
  for (int i = 0; i < 2; i++)
    for (int j = 0; j < 2; j++) held.phi[i][j] = e[i][j], held.gamma[i][j] = h * p[i][j];
  return held;
}

static void advance(const Held *s, double *x, double *y, double b0, double b1) {
  double x0 = *x, y0 = *y;
  *x = s->phi[0][0] * x0 + s->phi[0][1] * y0 + s->gamma[0][0] * b0 + s->gamma[0][1] * b1;
  *y = s->phi[1][0] * x0 + s->phi[1][1] * y0 + s->gamma[1][0] * b0 + s->gamma[1][1] * b1;
}

static double bound(double x, double low, double high) { return x < low ? low : x > high ? high : x; }

static double pi(double *integral, double p, double i, double e, double feed, double low, double high, double h) {
  double wanted = p * e + *integral + feed;
  if (!((wanted > high && e > 0) || (wanted < low && e < 0))) *integral += i * e * h;
  *integral = bound(*integral, fmin(low - feed, 0), fmax(high - feed, 0));
  return bound(p * e + *integral + feed, low, high);
}

static double coefficient(double w, double mu_d) {
  double mu = mu_d + (mu_0 - mu_d + alpha_1 * w) * exp(-alpha_2 * w);
  return mu > 0.02 ? mu : 0.02;
}

static double radius(double w, double theta) {
  static const double node[4] = {-0.8611363115940526, -0.33998104358485626, 0.33998104358485626, 0.8611363115940526};
  static const double weight[4] = {0.34785484513745385, 0.6521451548625461, 0.6521451548625461, 0.34785484513745385};
  double mean = 0.5 * (R_1 + R_2), half = 0.5 * (R_2 - R_1), mu_d = m_0 + theta * (m_1 + theta * m_2), sum = 0.0;
  if (w == 0.0) return coefficient(0.0, mu_d) * mean;
  double scale = w / mean;
  for (int i = 0; i < 4; i++) {
    double rho = mean + half * node[i];
    sum += weight[i] * coefficient(scale * rho, mu_d) * rho;
  }
  return 0.5 * sum;
}

static double spring_inverse(double wanted) {
  if (wanted <= 0) return xi_0;
  if (wanted >= beta[0] + beta[1] + beta[2]) return 1.0;
  double low = xi_0, high = 1.0, xi = 1.0;
  for (int k = 0; k < 64; k++) {
    double excess = xi * (beta[0] + xi * (beta[1] + xi * beta[2])) - wanted;
    if (excess > 0) high = xi; else low = xi;
    double newton = xi - excess / (beta[0] + xi * (2 * beta[1] + 3 * xi * beta[2]));
    double next = newton > low && newton < high ? newton : 0.5 * (low + high);
    if (fabs(next - xi) <= 2.220446049250313e-16) return next;
    xi = next;
  }
  return xi;
}

static double at_xi(double xi, double theta) {
  double d = theta - 25.0;
  double a = x_cnt[0] + d * (x_cnt[1] + d * x_cnt[2]), b = x_cls[0] + d * (x_cls[1] + d * x_cls[2]);
  return a + xi * (b - a);
}

static int near(const Inputs *u, double f, double c, double reach) { return fabs(u->omega_f - f) <= reach && fabs(u->omega_c - c) <= reach; }

static void guard(State *s, const Inputs *u, double h) {
  int slipping = s->mode == 1 && s->phase == 2;
  double reach = jump + acceleration * h;
  int valid = fabs(u->omega_f) <= 1e4 && fabs(u->omega_c) <= 1e4 && fabs(u->t_e) <= 1e4;
  int same = u->omega_f == s->last[0] && u->omega_c == s->last[1];
  int agrees = valid && near(u, s->last[0], s->last[1], reach) && !(same && s->fault == 4);
  s->agree_for = agrees ? s->agree_for + h : 0;
  s->unchanged_for = same && (slipping || s->fault == 4) ? s->unchanged_for + h : 0;
  if (valid) s->last[0] = u->omega_f, s->last[1] = u->omega_c;
  int settled = s->agree_for >= recover, verdict = 1;
  if (!valid) verdict = 2;
  else if (s->unchanged_for > freeze) verdict = 4;
  else if (s->started && !near(u, s->good.omega_f, s->good.omega_c, reach) && !settled) verdict = 3;
  s->believed = verdict == 1;
  if (s->believed) {
    double theta_h = fabs(u->theta_h) <= 1e3 ? u->theta_h : s->good.theta_h;
    s->good = *u;
    s->good.theta_h = theta_h;
    s->started = 1;
    if ((s->fault != 4 && s->bad_for <= hold) || settled) s->fault = 1, s->bad_for = 0;
  } else {
    s->fault = verdict;
    s->bad_for += h;
  }
  s->good.engage = u->engage;
}

/* References of speed and their slopes; the clutch's goes on with its last slope. */
static void references(const State *s, double *f, double *c, double *df, double *dc) {
  double a = s->elapsed / s->duration;
  if (a >= 1) {
    double over = s->slope * (s->elapsed - s->duration);
    *f = s->end, *c = s->end + fmin(over, 12.0), *df = 0, *dc = s->slope;
    return;
  }
  double rise = a * a * (3 - 2 * a), rate = 6 * a * (1 - a) / s->duration;
  *f = s->f0 + (s->end - s->f0) * rise;
  *c = s->c0 + (s->end - s->c0) * rise + s->slope * s->duration * a * a * (a - 1);
  *df = (s->end - s->f0) * rate;
  *dc = (s->end - s->c0) * rate + s->slope * a * (3 * a - 2);
}

static double share(double time, double h) { return h / (time + h); }

static double lags(double *y, int n, double u, const double *by) {
  for (int i = 0; i < n; i++) u = y[i] += (u - y[i]) * by[i];
  return u;
}

static double resistance(double w, double extra) { return b_c * w + T_L0 * tanh(w / w_L) + k_L * w * fabs(w) + extra; }

static double inertia_factor(const double *m) {
  double p = m[0] + 25.0, q = m[2] + 1.0 / 2500.0, d = p * q - m[1] * m[1];
  return d > 0 ? bound(1 + (m[3] * q - m[1] * m[4]) / d, 0.6, 1.6) : 1;
}

static void sums(double *to, double w, double a, double b, double c, double d, double e) {
  to[0] += w * a, to[1] += w * b, to[2] += w * c, to[3] += w * d, to[4] += w * e;
}

static double delivery(const State *s, double t) {
  return bound(2 - fabs(s->expected[2] - t) / (10 + 0.25 * s->expected[2]), 0, 1);
}

static void observe_load(State *s, const Inputs *u, double slip, double h) {
  double a = share(0.5 * actuator_time, h), f = share(filter_time, h), by[4] = {a, a, f, f};
  double torque = s->mode == 0 ? 0 : s->mode == 1 ? s->t_c_ref : s->t_hat;
  double w = lags(s->speed, 2, u->omega_c, by + 2);
  double quick[2] = {share(0.6 * filter_time, h), share(0.6 * filter_time, h)};
  lags(s->slip, 2, slip, quick);
  double t = lags(s->carried, 4, torque, by), departs = s->mode == 1 ? s->t_hat - s->expected[2] : 0;
  t = fmin(t + departs, fmax(s->t_hat, 0) + 10 + 0.25 * t);
  s->engaged_for = s->mode == 0 ? 0 : s->engaged_for + h;
  double band = fmax(fmin(3.0 / fmax(s->engaged_for, h), 20.0), load_band), slow = band * h / (1 + band * h), j = J_c * inertia_factor(s->inertia);
  double predicted = s->load_w + h * (t - resistance(s->load_w, s->load_t)) / j, error = w - predicted;
  s->load_w = predicted + error * slow * (2 - slow);
  s->load_t = bound(s->load_t - j * error * slow * slow / h, -t_max, t_max);
  if (s->mode == 1 && t > 10) {
    double acc = J_c * (s->speed[0] - s->speed[1]) / fmax(filter_time, h), r = t - resistance(w, 0) - acc;
    sums(s->inertia, h / 3.6, acc * acc, acc, 1, acc * r, r);
  }
}

static void move_to(State *s, double target, double h) {
  target = bound(target, x_open, x_max);
  double follows = s->mode == 0 ? INFINITY : s->follows, back = s->land_slip > 0 ? follows : INFINITY;
  s->x_to = fmin(fmax(target, s->x_to - fmin(rate_open, back) * h), s->x_to + fmin(rate_close, follows) * h);
}

/* Where the clutch carries a torque at a slip, and the slope there. */
static double inverse(const State *s, double torque, double slip, double *slope) {
  double per_force = 2 * radius(slip, s->theta_c), xi = spring_inverse(torque / per_force);
  double first = at_xi(0, s->theta_c), travel = at_xi(1, s->theta_c) - first;
  *slope = per_force * (beta[0] + xi * (2 * beta[1] + 3 * xi * beta[2])) / travel;
  return first + xi * travel;
}

/* The second half of the launch begins; by how much the torque's limit rises. */
static double begin_landing(State *s, double slip_there) {
  double last = fmax(s->t_c_ref, 0);
  if (s->land_slip > 0 || slip_there >= 0.5 * (s->end - s->c0) || s->bitten_for <= 0.1 || last <= 0.7 * s->expected[2]) return 0;
  double departs = s->t_hat - s->expected[2];
  s->land_slip = slip_there, s->land_torque = last + departs;
  for (int i = 0; i < 3; i++) s->expected[i] += departs;
  for (int i = 0; i < 4; i++) s->carried[i] += departs;
  s->hold_back += fmax(departs, 0), s->takes_over = departs, s->t_c_ref += departs;
  return fmax(departs, 0);
}

static void engage(State *s, const Inputs *u, double h) {
  double wf, wc, df, dc, a = share(0.5 * actuator_time, h), f = share(filter_time, h), lag = (b_f + l_1) / -l_2, o = share(lag, h);
  double by[4] = {a, a, f, f}, seen[3] = {a, a, o}, touch = at_xi(xi_0, s->theta_c) + s->touch;
  /* What the engine can spare. */
  references(s, &wf, &wc, &df, &dc);
  double available = te_max - b_f * u->omega_f - J_f * df - reserve, spare = u->omega_f - (fmin(wf, s->f0) - droop);
  s->hold_back += (ki_droop * spare + 15 * fmax(spare, 0) * fmax(spare, 0)) * h;
  s->hold_back = fmax(fmin(s->hold_back, s->t_c_ref + 20), 0);
  double limit = fmax(fmin(available, s->hold_back + kp_droop * fmin(spare, 0)), 0);
  /* The plan. */
  double j = J_c * inertia_factor(s->inertia), resist = resistance(s->load_w, s->load_t), wanted = j * dc;
  double by_torque = wanted > 0 ? bound((limit - resist) / wanted, 0, 1) : 1, error = s->wanted[3] - s->speed[1];
  double rate = fmin(fmin(by_torque, bound((20 - error) / 12, 0, 1)), delivery(s, s->t_hat));
  s->elapsed += rate * h * bound(1 - error / 8, 1, 3);
  if (s->elapsed >= s->duration) s->landing_for += h;
  references(s, &wf, &wc, &df, &dc);
  df *= rate, dc *= rate;
  s->near_for = s->from * s->slip[1] <= slip_lock ? s->near_for + h : 0;
  error = lags(s->wanted, 4, wc, by) - s->speed[1];
  /* The torque asked for. */
  double low = 0, high = 0, direction = 1, seen_slip = s->slip[1] + slip_lock;
  if (seen_slip < 0) low = -t_max, direction = -1;
  else high = bound((u->omega_f - stall) / stall_margin, 0, 1) * t_max;
  high = fmin(high, limit);
  double last = fmax(s->t_c_ref, 0), closing = s->land_slip > 0 ? (last - resist) / j : dc;
  double there = fmax(direction * (s->slip[1] + (actuator_time + 1.2 * filter_time) * (df - closing)), 0);
  if (direction > 0) high += begin_landing(s, there);
  if (s->land_slip > 0 && there > s->land_slip + 10) s->land_slip = s->land_torque = 0;
  last = fmax(s->t_c_ref, 0);
  int rising = !(s->land_slip > 0);
  double landing = 3 * j * s->slope, enough = resist + 0.13 * landing;
  if (rising) wanted = fmax(j * dc + resist + kpc * error, last);
  else {
    double ends = resist + landing, part = bound(there / s->land_slip, 0, 1);
    wanted = ends + (s->land_torque - ends) * part * (2 - part);
  }
  double late = fmax(s->engaged_for - 0.22, 0);
  double most = s->bitten_for > 0 || direction < 0 ? INFINITY : 20 + fmin(100 * late, 25) + 5 * late;
  double rise = 150 * fmax(delivery(s, direction * s->t_hat), 0.1);
  double t_c = fmin(bound(fmin(fmax(wanted, last - 400 * h), last + rise * h), low, high), most);
  int bites = s->bitten_for == 0 && direction * s->t_hat > 8;
  if (s->bitten_for > 0 && !(s->land_slip > 0) && direction * s->t_hat < 2 && s->expected[2] > 16) {
    s->bitten_for = fmax(s->bitten_for - 4 * h, 0);
    if (s->bitten_for == 0) s->follows = 1e6;
  } else if (bites || s->bitten_for > 0) s->bitten_for += h;
  double feed = t_c + direction * (0.3 * fabs(s->t_hat) - (s->bitten_for > 0 ? 0.3 : 1.0) * s->expected[2]);
  s->t_e_ref = pi(&s->i_engine, kpf, kif, wf - u->omega_f, feed, te_min, te_max, h);
  if (bites) {
    double lags = actuator_time + lag, speed = s->engaged_for > lags ? (touch - x_open) / (s->engaged_for - lags) : INFINITY;
    s->follows = fmin(0.7 * speed, 1e6);
    if (s->engaged_for > 0.9) t_c = fmin(t_c, 8 + fmax(s->k_map, 15) * speed * lags);
  }
  s->t_c_ref = t_c;
  double slip = fmax(there, 2 * slip_lock), least = rising && t_c < high ? s->x_to : x_open;
  /* The position. */
  double slope, x = inverse(s, fabs(t_c) / s->friction, slip, &slope) + s->touch;
  s->k_map = s->friction * fmax(slope, 0);
  double observed = direction * s->t_hat, lacks = lags(s->expected, 3, fabs(t_c), seen) - observed;
  s->lacking += (lacks - s->lacking) * share(0.1, h);
  double will = lacks + 0.3 * (lacks - s->lacking) / 0.1;
  will = will * lacks > 0 ? copysign(fmin(fabs(will), fabs(lacks)), lacks) : 0;
  double band = fmax(fmin(2.0 / fmax(s->engaged_for, h), 5.0), torque_band) * fmax(delivery(s, observed), 0.1);
  if (s->takes_over != 0) {
    double ignored, here = inverse(s, fmax(s->land_torque - s->takes_over, 0) / s->friction, slip, &ignored);
    s->i_torque += here - inverse(s, fmax(s->land_torque, 0) / s->friction, slip, &ignored), s->takes_over = 0;
  }
  int unfelt = s->bitten_for == 0, suffices = s->land_slip > 0 && observed > fmax(enough, 0.6 * t_c);
  double by_feedback = bound(band * will / fmax(s->k_map, 15), unfelt ? 0 : -1, unfelt || suffices ? 0 : 1);
  s->i_torque = bound(s->i_torque + by_feedback * h, -fb_max, fb_max);
  s->i_torque = fmax(s->i_torque, fmin(least - x, s->i_torque + h));
  s->x_fb = s->i_torque;
  if (slip > slip_lock) {
    double t = lags(s->learn_t, 3, fabs(t_c) + s->k_map * s->x_fb, seen), k = lags(s->learn_k, 3, s->k_map, seen), r = observed - t;
    if (t >= 3 || observed >= 3) sums(s->sums, h / 1.6, k * k, k * t, t * t, k * r, t * r);
  }
  move_to(s, fmax(x + s->x_fb, least), h);
}

/* What a launch has taught; this vehicle's touch point does not move with temperature. */
static void conclude(State *s) {
  double *m = s->sums, a = m[0] + 1 / (0.3 * 0.3), b = m[2] + 25, d = a * b - m[1] * m[1];
  if (d > 0) {
    s->touch = bound(s->touch + 0.5 * bound((-m[3] * b + m[1] * m[4]) / d, -0.5, 0.5), -3, 3);
    s->friction = bound(s->friction * (1 + 0.5 * bound((a * m[4] - m[1] * m[3]) / d, -0.3, 0.3)), 0.3, 3);
  }
  for (int i = 0; i < 5; i++) m[i] = 0;
}

static void step(State *s, const Inputs *raw, double h) {
  guard(s, raw, h);
  Inputs u = s->good;
  double slip = u.omega_f - u.omega_c;
  int trusted = s->started && (s->fault == 1 || (s->fault != 4 && s->bad_for <= hold)), stalling = trusted && u.omega_f < stall;
  if (s->mode == 0) {
    if (trusted && s->believed && u.engage && u.omega_f >= stall + stall_margin) {
      s->mode = 1;
      s->elapsed = 0;
      s->end = fmax(w_end, u.omega_c);
      double left = fmin((s->end - u.omega_c) / w_end, 1);
      s->duration = t_r * fmax(left, least_share);
      s->slope = end_slope * left;
      s->c0 = u.omega_c, s->f0 = u.omega_f;
      s->i_torque = s->e_d = 0;
      for (int i = 0; i < 4; i++) s->wanted[i] = u.omega_c;
      for (int i = 0; i < 3; i++) s->expected[i] = s->learn_t[i] = s->learn_k[i] = 0;
      for (int i = 0; i < 5; i++) s->inertia[i] = s->sums[i] = 0;
      s->lacking = 0, s->hold_back = s->follows = 1e6, s->land_slip = s->takes_over = 0;
      s->bitten_for = s->near_for = s->landing_for = s->closing_for = 0;
      s->from = slip < 0 ? -1 : 1;
    }
  } else if (s->mode == 1) {
    if (!u.engage || !trusted || stalling) s->mode = 0;
    else if (s->near_for > lock_time || (s->landing_for > landing_time && fabs(s->slip[1]) <= slip_lock + 0.06 * fabs(u.omega_f)))
{
      double wf, wc, df, dc;
      references(s, &wf, &wc, &df, &dc);
      s->i_engine = s->t_e_ref - 2 * kpf * (wf - s->speed[1] - 0.5 * s->slip[1]), s->mode = 3, conclude(s);
    }
  } else if (!u.engage || stalling) s->i_engine -= s->t_hat, s->mode = 0;
  if (s->started) {
    if (!s->observing) {
      s->observing = 1, s->omega_hat = u.omega_f, s->i_engine = b_f * u.omega_f;
      s->speed[0] = s->speed[1] = s->load_w = s->last_c = u.omega_c, s->slip[0] = s->slip[1] = slip;
    }
    double before = s->t_hat, w_before = s->omega_hat;
    if (s->believed) advance(&observer, &s->omega_hat, &s->t_hat, (u.t_e + l_1 * u.omega_f) / J_f, l_2 * u.omega_f);
    double mean = 0.5 * (before + s->t_hat) + (b_f + l_1) / -l_2 * (s->t_hat - before) / h;
    double mean_slip = 0.5 * (w_before + s->omega_hat) - 0.5 * (s->last_c + u.omega_c), power = s->phase == 2 ? mean * mean_slip : 0;
    s->last_c = u.omega_c;
    if (s->phase != 1) advance(&engaged_system, &s->theta_c, &s->theta_b, gamma_3 * power / C_1, (gamma_2 * u.theta_h + (1 - gamma_3) * power) / C_b);
    else advance(&open_system, &s->theta_c, &s->theta_b, gamma_2 * u.theta_h / C_1, 2 * gamma_2 * u.theta_h / C_b);
    s->e_d += power * h;
    if (s->believed) observe_load(s, &u, slip, h);
  }
  if (s->mode == 0) {
    double feed = s->x_to > at_xi(xi_0, s->theta_c) + s->touch ? s->t_hat : 0;
    s->t_e_ref = s->believed && u.omega_f > 0.5 * stall ? pi(&s->i_engine, kpf, kif, idle - u.omega_f, feed, te_min, te_max, h) : bound(b_f * idle, te_min, te_max);
    s->t_c_ref = s->x_fb = 0;
    move_to(s, x_open, h);
  } else if (s->mode == 1 && s->believed) {
    engage(s, &u, h);
  } else if (s->mode >= 2) {
    if (s->believed) {
      double wf, wc, df, dc, i = kif * J_f / (J_f + J_c);
      s->elapsed += h;
      references(s, &wf, &wc, &df, &dc);
      s->t_e_ref = pi(&s->i_engine, 2 * kpf, 2 * i, wf - s->speed[1] - 0.5 * s->slip[1], 0, te_min, te_max, h);
    }
    s->t_c_ref = s->t_hat;
    if (s->mode == 2) {
      s->x_fb = 0;
      move_to(s, x_max, h);
    } else {
      s->closing_for += h;
      double gently = closing_rate * fmin(s->closing_for / 0.25, 1) * h / fmax(s->k_map, 15);
      move_to(s, s->x_to + (s->closing_for < 0.25 ? gently : fmax(gently, 20 * h)), h);
      if (s->x_to >= x_max) s->mode = 2;
    }
  }
  s->last_slip = slip;
  s->phase = s->mode >= 2 && fabs(s->slip[1]) <= slip_release ? 3 : s->x_to > at_xi(xi_0, s->theta_c) + s->touch ? 2 : 1;
}

static double now(void) {
  struct timespec t;
  clock_gettime(CLOCK_MONOTONIC, &t);
  return 1e9 * t.tv_sec + t.tv_nsec;
}

static int ascending(const void *a, const void *b) {
  double d = *(const double *)a - *(const double *)b;
  return d < 0 ? -1 : d > 0;
}

int main(void) {
  xi_0 = -0.5 * (beta[1] - sqrt(beta[1] * beta[1] - 4.0 * beta[0] * beta[2])) / beta[2];
  observer = transition(-(b_f + l_1) / J_f, -1 / J_f, -l_2, 0, 1e-3);
  engaged_system = transition(-gamma_1 / C_1, gamma_1 / C_1, gamma_1 / C_b, -(gamma_1 + gamma_2) / C_b, 1e-3);
  open_system = transition(-gamma_2 / C_1, 0, 0, -2 * gamma_2 / C_b, 1e-3);
  static Inputs inputs[STEPS];
  for (int k = 0; k < STEPS; k++) {
    double t = k * 1e-3, a = t / 1.2;
    inputs[k] = (Inputs){104.7 + 4.0 * a, 100.0 * a * a, 3.0 + 60.0 * a, 25.0, 1};
  }
  static double batch[LAUNCHES];
  State s;
  for (int b = 0; b < LAUNCHES; b++) {
    s = (State){.phase = 1, .fault = 1, .theta_c = 25.0, .theta_b = 25.0, .good = {0, 0, 0, 25.0, 0}, .friction = 1};
    double begin = now();
    for (int k = 0; k < STEPS; k++) step(&s, &inputs[k], 1e-3);
    batch[b] = (now() - begin) / STEPS;
  }
  qsort(batch, LAUNCHES, sizeof batch[0], ascending);
  printf("%.2f %.12g %.12g %.12g\n", batch[LAUNCHES / 2], s.x_to, s.theta_c, s.t_e_ref);
  return 0;
}
