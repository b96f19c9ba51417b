/* What the C boundary costs: a step, a value, a saved state, an instance. Prints name and figure; benches/boundary.sh runs it.
 *
 *   boundary LIBRARY PLANT_GUID RESOURCES_URI
 */
#include <dlfcn.h>
#include <stdio.h>
#include <stdlib.h>
#include <time.h>

enum { STEPS = 2000, LAUNCHES = 101, CALLS = 20000 };
typedef void *Component;
static Component (*instantiate)(const char *, int, const char *, const char *, void *const *, int, int);
static void (*release)(Component);
static int (*setup)(Component, int, double, double, int, double), (*enter)(Component), (*leave)(Component), (*reset)(Component);
static int (*get)(Component, const unsigned *, size_t, double *), (*set)(Component, const unsigned *, size_t, const double *);
static int (*step)(Component, double, double, int), (*save)(Component, void **), (*restore)(Component, void *);

static const unsigned inputs[] = {1, 2}, outputs[] = {11, 12, 13, 14, 15, 16, 17, 18};

static double now(void) {
    struct timespec t;
    clock_gettime(CLOCK_MONOTONIC, &t);
    return 1e9 * (double)t.tv_sec + (double)t.tv_nsec;
}
static int ascending(const void *a, const void *b) { return (*(const double *)a > *(const double *)b) - (*(const double *)a < *(const double *)b); }
static double median(double *x, int n) { return qsort(x, (size_t)n, sizeof *x, ascending), x[n / 2]; }
static void must(int status) {
    if (status > 1) fprintf(stderr, "status %d\n", status), exit(1);
}
static void *symbol(void *library, const char *name) {
    void *found = dlsym(library, name);
    if (!found) fprintf(stderr, "%s is missing\n", name), exit(2);
    return found;
}
static void begin(Component c) { must(reset(c)), must(setup(c, 0, 0, 0, 0, 0)), must(enter(c)), must(leave(c)); }

int main(int count, char **arguments) {
    void *library = count == 4 ? dlopen(arguments[1], RTLD_NOW) : NULL;
    if (!library) return fputs("usage: see the head of boundary.c\n", stderr), 2;
#define RESOLVE(pointer, name) *(void **)&pointer = symbol(library, "fmi2" name)
    RESOLVE(instantiate, "Instantiate"), RESOLVE(release, "FreeInstance"), RESOLVE(setup, "SetupExperiment"), RESOLVE(enter, "EnterInitializationMode");
    RESOLVE(leave, "ExitInitializationMode"), RESOLVE(reset, "Reset"), RESOLVE(get, "GetReal"), RESOLVE(set, "SetReal");
    RESOLVE(step, "DoStep"), RESOLVE(save, "GetFMUstate"), RESOLVE(restore, "SetFMUstate");
    void *const callbacks[5] = {0};
    static double batch[LAUNCHES];
    double x[8];
    static double freed[LAUNCHES];
    for (int b = 0; b < LAUNCHES; b++) {
        Component made[20];
        double began = now();
        for (int k = 0; k < 20; k++) {
            made[k] = instantiate("x", 1, arguments[2], arguments[3], callbacks, 0, 0);
            if (!made[k]) return fputs("not instantiated\n", stderr), 1;
        }
        batch[b] = (now() - began) / 20;
        began = now();
        for (int k = 0; k < 20; k++) release(made[k]);
        freed[b] = (now() - began) / 20;
    }
    printf("instantiate_us %.2f\nfree_us %.2f\n", 1e-3 * median(batch, LAUNCHES), 1e-3 * median(freed, LAUNCHES));
    Component c = instantiate("x", 1, arguments[2], arguments[3], callbacks, 0, 0);
    /* The launch of benches/peer/plant.c: steps with their inputs, then the inputs alone. */
    for (int b = 0; b < LAUNCHES; b++) {
        begin(c);
        double began = now();
        for (int k = 0; k < STEPS; k++) {
            double t = k * 1e-3, u[] = {t < 1.6 ? 4.5 + 1.2 * (t < 1.0 ? t : 1.0) : 8.2, t < 1.9 ? 30.0 : 60.0};
            must(set(c, inputs, 2, u)), must(step(c, t, 1e-3, 1));
        }
        batch[b] = (now() - began) / STEPS;
    }
    double both = median(batch, LAUNCHES);
    for (int b = 0; b < LAUNCHES; b++) {
        double began = now();
        for (int k = 0; k < STEPS; k++) {
            double t = k * 1e-3, u[] = {t < 1.6 ? 4.5 + 1.2 * (t < 1.0 ? t : 1.0) : 8.2, t < 1.9 ? 30.0 : 60.0};
            must(set(c, inputs, 2, u));
        }
        batch[b] = (now() - began) / STEPS;
    }
    double alone = median(batch, LAUNCHES);
    printf("set_two_inputs_ns %.2f\ndo_step_ns %.2f\n", alone, both - alone);
    for (int b = 0; b < LAUNCHES; b++) {
        double began = now();
        for (int k = 0; k < CALLS; k++) get(c, outputs, 1, x);
        batch[b] = (now() - began) / CALLS;
    }
    printf("get_real_ns %.2f\n", median(batch, LAUNCHES));
    for (int b = 0; b < LAUNCHES; b++) {
        double began = now();
        for (int k = 0; k < CALLS; k++) get(c, outputs, 8, x);
        batch[b] = (now() - began) / CALLS / 8;
    }
    printf("get_real_of_eight_ns_each %.2f\n", median(batch, LAUNCHES));
    void *state = NULL;
    must(save(c, &state));
    for (int b = 0; b < LAUNCHES; b++) {
        double began = now();
        for (int k = 0; k < CALLS / 10; k++) must(save(c, &state)), must(restore(c, state));
        batch[b] = (now() - began) / (CALLS / 10);
    }
    printf("get_and_set_state_ns %.2f\n", median(batch, LAUNCHES));
    return 0;
}
