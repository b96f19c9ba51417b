/* The nominal plant by hand in C: the yardstick of benches/step.rs. Same scheme as the Rust plant without its effects: one
 * Runge-Kutta step of fourth order per millisecond, four Gauss points over the facing, lock-up located by regula falsi.
 * Prints nanoseconds per step (median of batches) and the final state. */
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <time.h>

#define N 8 /* omega_f, omega_c, theta_c, theta_b, angle, e_d, work in, losses */
#define STEPS 2000
#define LAUNCHES 200

typedef struct {
  double R_1, R_2, mu_0, alpha_1, alpha_2, m_0, m_1, m_2;
  double x_cnt[3], x_cls[3], beta[3], xi_0;
  double C_1, C_b, gamma_1, gamma_2, gamma_3;
  double J_f, J_c, b_f, b_c, T_L0, omega_L, k_L;
} Vehicle;

typedef struct {
  double y[N];
  int stuck;
  double direction;
} Plant;

typedef struct {
  double x_to, t_e, theta_h, t_load;
} Inputs;

static double coefficient(const Vehicle *v, double w, double mu_d) {
  double mu = mu_d + (v->mu_0 - mu_d + v->alpha_1 * w) * exp(-v->alpha_2 * w);
  return mu > 0.02 ? mu : 0.02;
}

static double radius(const Vehicle *v, double w, double theta) {
  static const double node[4] = {-0.8611363115940526, -0.33998104358485626, 0.33998104358485626, 0.8611363115940526};
  static const double weight[4] = {0.34785484513745385, 0.6521451548625461, 0.6521451548625461, 0.34785484513745385};
  double mean = 0.5 * (v->R_1 + v->R_2), half = 0.5 * (v->R_2 - v->R_1), mu_d = v->m_0 + theta * (v->m_1 + theta * v->m_2);
  if (w == 0.0) return coefficient(v, 0.0, mu_d) * mean;
  double sum = 0.0, scale = w / mean;
  for (int i = 0; i < 4; i++) {
    double rho = mean + half * node[i];
    sum += weight[i] * coefficient(v, scale * rho, mu_d) * rho;
  }
  return 0.5 * sum;
}

static double normalised(const Vehicle *v, double x, double theta) {
  double d = theta - 25.0;
  double a = v->x_cnt[0] + d * (v->x_cnt[1] + d * v->x_cnt[2]), b = v->x_cls[0] + d * (v->x_cls[1] + d * v->x_cls[2]);
  double xi = (x - a) / (b - a);
  return xi < 0.0 ? 0.0 : xi > 1.0 ? 1.0 : xi;
}

static double capacity(const Vehicle *v, double x, double w, double theta) {
  double xi = normalised(v, x, theta);
  if (xi <= v->xi_0) return 0.0;
  double force = xi * (v->beta[0] + xi * (v->beta[1] + xi * v->beta[2]));
  return force > 0.0 ? 2.0 * radius(v, w, theta) * force : 0.0;
}

static double resistance(const Vehicle *v, double w, double t_load) {
  return v->b_c * w + v->T_L0 * tanh(w / v->omega_L) + v->k_L * w * fabs(w) + t_load;
}

static double holding(const Vehicle *v, double w, double t_e, double resist) {
  return (v->J_c * (t_e - v->b_f * w) + v->J_f * resist) / (v->J_f + v->J_c);
}

static void rates(const Vehicle *v, const Plant *p, const Inputs *u, int engaged, const double *y, double *dy) {
  double resist = resistance(v, y[1], u->t_load), t_fc, slip;
  if (p->stuck) {
    t_fc = holding(v, y[0], u->t_e, resist);
    dy[0] = dy[1] = (u->t_e - v->b_f * y[0] - t_fc) / v->J_f;
    slip = 0.0;
  } else {
    slip = y[0] - y[1];
    double along = p->direction * slip;
    t_fc = p->direction * capacity(v, u->x_to, along > 0.0 ? along : 0.0, y[2]);
    dy[0] = (u->t_e - v->b_f * y[0] - t_fc) / v->J_f;
    dy[1] = (t_fc - resist) / v->J_c;
  }
  double power = t_fc * slip;
  if (engaged) {
    double exchange = v->gamma_1 * (y[3] - y[2]);
    dy[2] = (exchange + v->gamma_3 * power) / v->C_1;
    dy[3] = (-exchange + v->gamma_2 * (u->theta_h - y[3]) + (1.0 - v->gamma_3) * power) / v->C_b;
  } else {
    dy[2] = v->gamma_2 * (u->theta_h - y[2]) / v->C_1;
    dy[3] = 2.0 * v->gamma_2 * (u->theta_h - y[3]) / v->C_b;
  }
  dy[4] = slip;
  dy[5] = power;
  dy[6] = u->t_e * y[0];
  dy[7] = v->b_f * y[0] * y[0] + resist * y[1];
}

static void runge_kutta(const Vehicle *v, const Plant *p, const Inputs *u, int engaged, double h, double *next) {
  double k1[N], k2[N], k3[N], k4[N], z[N];
  rates(v, p, u, engaged, p->y, k1);
  for (int i = 0; i < N; i++) z[i] = p->y[i] + 0.5 * h * k1[i];
  rates(v, p, u, engaged, z, k2);
  for (int i = 0; i < N; i++) z[i] = p->y[i] + 0.5 * h * k2[i];
  rates(v, p, u, engaged, z, k3);
  for (int i = 0; i < N; i++) z[i] = p->y[i] + h * k3[i];
  rates(v, p, u, engaged, z, k4);
  for (int i = 0; i < N; i++) next[i] = p->y[i] + h / 6.0 * (k1[i] + 2.0 * (k2[i] + k3[i]) + k4[i]);
  if (p->stuck) next[1] = next[0];
}

/* Positive once the event that ends this motion has happened. */
static double passed(const Vehicle *v, const Plant *p, const Inputs *u, const double *y) {
  if (!p->stuck) return -p->direction * (y[0] - y[1]);
  return fabs(holding(v, y[0], u->t_e, resistance(v, y[1], u->t_load))) - capacity(v, u->x_to, 0.0, y[2]);
}

static void settle(const Vehicle *v, Plant *p, const Inputs *u) {
  double hold = holding(v, p->y[0], u->t_e, resistance(v, p->y[1], u->t_load)), most = capacity(v, u->x_to, 0.0, p->y[2]);
  p->stuck = fabs(hold) <= most && most > 0.0;
  if (!p->stuck) p->direction = hold < 0.0 ? -1.0 : 1.0;
}

static void step(const Vehicle *v, Plant *p, const Inputs *u, double h) {
  double left = h, next[N];
  for (int events = 0; left > 1e-12; events++) {
    if (p->stuck && passed(v, p, u, p->y) > 0.0) {
      p->direction = holding(v, p->y[0], u->t_e, resistance(v, p->y[1], u->t_load)) < 0.0 ? -1.0 : 1.0;
      p->stuck = 0;
    }
    int engaged = normalised(v, u->x_to, p->y[2]) > v->xi_0;
    runge_kutta(v, p, u, engaged, left, next);
    double at_high = passed(v, p, u, next);
    if (at_high <= 0.0 || events >= 8) {
      for (int i = 0; i < N; i++) p->y[i] = next[i];
      return;
    }
    double low = 0.0, high = left, at_low = passed(v, p, u, p->y), found[N];
    if (at_low > 0.0) at_low = 0.0;
    for (int i = 0; i < N; i++) found[i] = next[i];
    for (int k = 0; k < 60 && high - low > 4e-16 * high; k++) {
      double middle = high - at_high * (high - low) / (at_high - at_low);
      if (!(middle > low && middle < high)) middle = 0.5 * (low + high);
      runge_kutta(v, p, u, engaged, middle, next);
      double value = passed(v, p, u, next);
      if (value > 0.0) {
        at_low *= 0.5;
        high = middle;
        at_high = value;
        for (int i = 0; i < N; i++) found[i] = next[i];
        if (value < 1e-12) break;
      } else {
        at_high *= 0.5;
        low = middle;
        at_low = value;
      }
    }
    for (int i = 0; i < N; i++) p->y[i] = found[i];
    left -= high;
    if (p->stuck) {
      p->direction = holding(v, p->y[0], u->t_e, resistance(v, p->y[1], u->t_load)) < 0.0 ? -1.0 : 1.0;
      p->stuck = 0;
    } else {
      p->y[0] = p->y[1] = (v->J_f * p->y[0] + v->J_c * p->y[1]) / (v->J_f + v->J_c);
      settle(v, p, u);
    }
  }
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
  Vehicle v = {0.074, 0.108, 0.15, 0.02, 0.3, 0.1834, 0.0024, -7.06e-06, {4.02, 0, 0}, {7.78, 0, 0}, {26.1195, -1304.6, 5818.5}, 0,
               70.0, 6928.0, 14.58, 25.0, 0.5, 0.189, 0.578, 0.03, 0.012, 3.1, 0.5, 2e-05};
  double q = -0.5 * (v.beta[1] - sqrt(v.beta[1] * v.beta[1] - 4.0 * v.beta[0] * v.beta[2]));
  v.xi_0 = q / v.beta[2];
  static Inputs inputs[STEPS];
  for (int k = 0; k < STEPS; k++) {
    double t = k * 1e-3;
    inputs[k] = (Inputs){t < 1.6 ? 4.5 + 1.2 * (t < 1.0 ? t : 1.0) : 8.2, t < 1.9 ? 30.0 : 60.0, 25.0, 0.0};
  }
  static double batch[LAUNCHES];
  Plant p;
  for (int b = 0; b < LAUNCHES; b++) {
    p = (Plant){{104.71975511965978, 0.0, 25.0, 25.0}, 0, 1.0};
    double begin = now();
    for (int k = 0; k < STEPS; k++) step(&v, &p, &inputs[k], 1e-3);
    batch[b] = (now() - begin) / STEPS;
  }
  qsort(batch, LAUNCHES, sizeof batch[0], ascending);
  printf("%.2f %.12g %.12g %.12g\n", batch[LAUNCHES / 2], p.y[0], p.y[2], p.y[5]);
  return 0;
}
