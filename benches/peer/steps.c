/* Steps an FMU from C, for benches/pythonfmu.py: what a step costs without FMPy's share. Returns the seconds that the steps took. */
#include <stddef.h>
#include <time.h>

static double now(void) {
  struct timespec t;
  clock_gettime(CLOCK_MONOTONIC, &t);
  return (double)t.tv_sec + 1e-9 * (double)t.tv_nsec;
}

double steps(void *component, int (*set)(void *, const unsigned *, size_t, const double *), int (*step)(void *, double, double, int),
             const unsigned *references, const double *inputs, long count, double h) {
  double begin = now();
  for (long k = 0; k < count; k++) {
    if (set(component, references, 2, inputs + 2 * k) > 1 || step(component, (double)k * h, h, 1) > 1) return -1.0;
  }
  return now() - begin;
}
