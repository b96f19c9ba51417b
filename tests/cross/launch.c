/* The coupled launch through the C interface, on any platform: prints every output at its end with all digits.
 *
 *   launch LIBRARY PLANT_GUID CONTROLLER_GUID
 */
#include <stdio.h>
#include <stdlib.h>
#ifdef _WIN32
#include <windows.h>
static void *open_library(const char *path) { return (void *)LoadLibraryA(path); }
static void *find(void *library, const char *name) { return (void *)(size_t)GetProcAddress((HMODULE)library, name); }
#else
#include <dlfcn.h>
static void *open_library(const char *path) { return dlopen(path, RTLD_NOW); }
static void *find(void *library, const char *name) { return dlsym(library, name); }
#endif

typedef void *Component;
static Component (*instantiate)(const char *, int, const char *, const char *, void *const *, int, int);
static int (*setup)(Component, int, double, double, int, double), (*enter)(Component), (*leave)(Component);
static int (*get)(Component, const unsigned *, size_t, double *), (*set)(Component, const unsigned *, size_t, const double *);
static int (*step)(Component, double, double, int);

static const unsigned measured[] = {11, 12, 13}, sensed[] = {1, 2, 3}; /* omega_f, omega_c, T_e: plant, controller */
static const unsigned wanted[] = {11, 15}, commanded[] = {1, 2};       /* x_to, T_e_ref: controller, plant */
static const unsigned all[] = {11, 12, 13, 14, 15, 16, 17, 18};

static void must(int status) {
    if (status > 1) printf("status %d\n", status), exit(1);
}
static void *symbol(void *library, const char *name) {
    void *found = find(library, name);
    if (!found) printf("%s is missing\n", name), exit(2);
    return found;
}
static Component started(const char *guid) {
    void *const callbacks[5] = {0};
    Component c = instantiate("x", 1, guid, NULL, callbacks, 0, 0);
    if (!c) puts("not instantiated"), exit(1);
    must(setup(c, 0, 0, 0, 0, 0)), must(enter(c)), must(leave(c));
    return c;
}

int main(int count, char **arguments) {
    void *library = count == 4 ? open_library(arguments[1]) : NULL;
    if (!library) return puts("no library"), 2;
    double x[8];
    *(void **)&instantiate = symbol(library, "fmi2Instantiate"), *(void **)&setup = symbol(library, "fmi2SetupExperiment");
    *(void **)&enter = symbol(library, "fmi2EnterInitializationMode"), *(void **)&leave = symbol(library, "fmi2ExitInitializationMode");
    *(void **)&get = symbol(library, "fmi2GetReal"), *(void **)&set = symbol(library, "fmi2SetReal"), *(void **)&step = symbol(library, "fmi2DoStep");
    Component plant = started(arguments[2]), controller = started(arguments[3]);
    for (int k = 0; k < 2500; k++) {
        must(get(controller, wanted, 2, x)), must(set(plant, commanded, 2, x)), must(step(plant, k * 1e-3, 1e-3, 1));
        must(get(plant, measured, 3, x)), must(set(controller, sensed, 3, x)), must(step(controller, k * 1e-3, 1e-3, 1));
    }
    must(get(plant, all, 8, x));
    for (int k = 0; k < 8; k++) printf("plant %u %.17g\n", all[k], x[k]);
    must(get(controller, all, 8, x));
    for (int k = 0; k < 8; k++) printf("controller %u %.17g\n", all[k], x[k]);
    return 0;
}
