/* Holds a real-time step of both FMUs, coupled, and shows how long the steps took.
 *
 *   cc -O2 benches/realtime.c -o realtime -ldl -lm
 *   ./realtime LIBRARY PLANT_GUID CONTROLLER_GUID STEP_US SECONDS [rollback]
 *
 * Every STEP_US the controller gets the plant's outputs, both are stepped, and the plant gets the controller's. With `rollback`, both
 * states are saved in every step, and the step is made three times, from the restored states: it is the same work each time, so the
 * least of the three is what the step takes where nothing interrupts it. Every two seconds the launch begins anew, and in
 * its middle an effect is injected. In the same period a loop of bare arithmetic follows that takes as long as a median step: its tail is what
 * this machine does to any program, and a step that is late where this loop never is would be ours. Exits with 1 if a step took longer than
 * STEP_US.
 */
#define _GNU_SOURCE
#include <dlfcn.h>
#include <sched.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/mman.h>
#include <time.h>

typedef void *Component;
typedef struct {
    void *logger, *allocate, *release, *finished, *environment;
} Callbacks;

static Component (*instantiate)(const char *, int, const char *, const char *, const Callbacks *, int, int);
static int (*setup)(Component, int, double, double, int, double), (*enter)(Component), (*leave)(Component), (*reset)(Component);
static int (*get)(Component, const unsigned *, size_t, double *), (*set)(Component, const unsigned *, size_t, const double *);
static int (*step)(Component, double, double, int), (*save)(Component, void **), (*restore)(Component, void *);

static const unsigned measured[] = {11, 12, 13}, sensed[] = {1, 2, 3}; /* omega_f, omega_c, T_e: plant, controller */
static const unsigned wanted[] = {11, 15}, commanded[] = {1, 2};       /* x_to, T_e_ref: controller, plant */
static const unsigned friction_factor = 1019;

static double read_clock(clockid_t clock) {
    struct timespec t;
    clock_gettime(clock, &t);
    return (double)t.tv_sec + 1e-9 * (double)t.tv_nsec;
}
static double now(void) { return read_clock(CLOCK_MONOTONIC); }
static long resident_kb(void) {
    long kb = 0;
    char line[256];
    FILE *file = fopen("/proc/self/status", "r");
    while (file && fgets(line, sizeof line, file))
        if (sscanf(line, "VmRSS: %ld", &kb) == 1) break;
    if (file) fclose(file);
    return kb;
}
static void must(int status, const char *what) {
    if (status > 1) fprintf(stderr, "%s: status %d\n", what, status), exit(2);
}
static void begin(Component c) { must(reset(c), "reset"), must(setup(c, 0, 0, 0, 0, 0), "setup"), must(enter(c), "enter"), must(leave(c), "leave"); }
static void exchange(Component from, const unsigned *a, Component to, const unsigned *b, size_t n) {
    double x[3];
    must(get(from, a, n, x), "get"), must(set(to, b, n, x), "set");
}
/* Arithmetic without memory, calls or branches on data. */
static double idle_work(long rounds) {
    double x = 1.0;
    for (long k = 0; k < rounds; k++) x += 1.0 / x;
    return x;
}
static volatile double kept;
/* Rounds of it that take this long, s: the best of many, so that no interruption counts. */
static long rounds_for(double seconds) {
    double best = 1.0;
    for (int k = 0; k < 200; k++) {
        double began = now();
        kept = idle_work(10000);
        double took = now() - began;
        if (took < best) best = took;
    }
    return (long)(seconds / best * 10000.0) + 1;
}
static int ascending(const void *a, const void *b) { return (*(const float *)a > *(const float *)b) - (*(const float *)a < *(const float *)b); }

/* Sorts, and prints median, tail and histogram. */
static void show(const char *what, float *took, long steps, double period_us) {
    qsort(took, (size_t)steps, sizeof *took, ascending);
    long late = 0, at = 0;
    while (late < steps && took[steps - 1 - late] > period_us) late++;
    printf("%-16s median %.2f us, 99 %% %.2f us, 99.99 %% %.2f us, worst %.2f us; %ld late\n", what, took[steps / 2], took[steps / 100 * 99],
        took[(long)((double)steps * 0.9999)], took[steps - 1], late);
    for (double edge = 0.5; at < steps; edge *= 2) {
        long first = at;
        while (at < steps && took[at] <= edge) at++;
        if (at > first) printf("  up to %8.1f us: %ld\n", edge, at - first);
    }
}

static void *symbol(void *library, const char *name) {
    void *found = dlsym(library, name);
    if (!found) fprintf(stderr, "%s is missing\n", name), exit(2);
    return found;
}

/* One period: measured values to the controller, both steps, commands to the plant. Returns the least time that a pass took, us. */
static float advance(Component plant, Component controller, void **saved_plant, void **saved_controller, double t, double period, int passes) {
    double least = 1.0;
    for (int pass = 0; pass < passes; pass++) {
        double began = now();
        if (passes > 1) {
            if (pass == 0) save(plant, saved_plant), save(controller, saved_controller);
            else must(restore(plant, *saved_plant), "restore"), must(restore(controller, *saved_controller), "restore");
        }
        exchange(plant, measured, controller, sensed, 3);
        must(step(controller, t, period, passes == 1), "controller"), must(step(plant, t, period, passes == 1), "plant");
        double spent = now() - began;
        if (spent < least) least = spent;
    }
    exchange(controller, wanted, plant, commanded, 2);
    return (float)(1e6 * least);
}

int main(int count, char **arguments) {
    if (count < 6) return fputs("usage: see the head of realtime.c\n", stderr), 2;
    void *library = dlopen(arguments[1], RTLD_NOW);
    if (!library) return fprintf(stderr, "%s\n", dlerror()), 2;
#define RESOLVE(pointer, name) *(void **)&pointer = symbol(library, "fmi2" name)
    RESOLVE(instantiate, "Instantiate"), RESOLVE(setup, "SetupExperiment"), RESOLVE(enter, "EnterInitializationMode");
    RESOLVE(leave, "ExitInitializationMode"), RESOLVE(reset, "Reset"), RESOLVE(get, "GetReal"), RESOLVE(set, "SetReal");
    RESOLVE(step, "DoStep"), RESOLVE(save, "GetFMUstate"), RESOLVE(restore, "SetFMUstate");
    Callbacks none = {0};
    Component plant = instantiate("plant", 1, arguments[2], NULL, &none, 0, 0);
    Component controller = instantiate("controller", 1, arguments[3], NULL, &none, 0, 0);
    if (!plant || !controller) return fputs("the GUIDs are not the library's\n", stderr), 2;
    double period = 1e-6 * atof(arguments[4]);
    long steps = (long)(atof(arguments[5]) / period + 0.5), per_launch = (long)(2.0 / period + 0.5);
    int passes = count > 6 ? 3 : 1, realtime;
    void *saved_plant = NULL, *saved_controller = NULL;
    float *took = calloc((size_t)steps, sizeof *took), *bare = calloc((size_t)steps, sizeof *bare), *least = calloc((size_t)steps, sizeof *least);
    if (!took || !bare || !least) return fputs("no memory for so many steps\n", stderr), 2;
    memset(took, 1, (size_t)steps * sizeof *took), memset(bare, 1, (size_t)steps * sizeof *bare), memset(least, 1, (size_t)steps * sizeof *least);
    struct sched_param priority = {.sched_priority = 80};
    realtime = sched_setscheduler(0, SCHED_FIFO, &priority) == 0 && mlockall(MCL_CURRENT | MCL_FUTURE) == 0;
    begin(plant), begin(controller), save(plant, &saved_plant), save(controller, &saved_controller);
    /* A quarter of a launch in one go warms everything up, and tells how long the arithmetic has to be. */
    long warm = per_launch / 4;
    if (warm > steps) warm = steps;
    for (long k = 0; k < warm; k++) {
        double began = now();
        advance(plant, controller, &saved_plant, &saved_controller, (double)k * period, period, passes);
        took[k] = (float)(now() - began);
    }
    qsort(took, (size_t)warm, sizeof *took, ascending);
    long rounds = rounds_for(took[warm / 2]), memory = resident_kb();
    double start = now();
    for (long k = 0; k < steps; k++) {
        double due = start + (double)k * period;
        struct timespec wake = {(time_t)due, (long)(1e9 * (due - (double)(time_t)due))};
        clock_nanosleep(CLOCK_MONOTONIC, TIMER_ABSTIME, &wake, NULL);
        long n = k % per_launch;
        if (n == 0) begin(plant), begin(controller);
        double factor = 0.8, began = now();
        if (n == per_launch / 4) must(set(plant, &friction_factor, 1, &factor), "inject");
        least[k] = advance(plant, controller, &saved_plant, &saved_controller, (double)n * period, period, passes);
        double ended = now();
        took[k] = (float)(1e6 * (ended - began));
        kept = idle_work(rounds);
        bare[k] = (float)(1e6 * (now() - ended));
    }
    long grown = resident_kb() - memory;
    printf("%ld steps of %g us, %s%s; memory grew by %ld kB\n", steps, 1e6 * period, realtime ? "SCHED_FIFO" : "ordinary scheduling", passes > 1 ? ", rolled back each step" : "", grown);
    show("both FMUs", took, steps, 1e6 * period);
    if (passes > 1) show("least of three", least, steps, 1e6 * period);
    show("bare arithmetic", bare, steps, 1e6 * period);
    return took[steps - 1] > 1e6 * period;
}
