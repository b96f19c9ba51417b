/* Misuses the shared library in every way we can think of: each misuse must be an error return with a logged reason, or correct, and
 * the instance must go on afterwards.
 *
 *   abuse LIBRARY NAME GUID BOUNDED BOUND FIXED TUNABLE REAL_OUTPUT ENUM_OUTPUT INPUT RESOURCES [quick]
 *
 * RESOURCES is the URI of a folder with the vehicle file of the paper's car.
 * The seven numbers are a value reference of each kind, and a value just beyond the bound of the first, a Real that may be set at any time.
 */
#define _GNU_SOURCE
#include <dlfcn.h>
#include <fenv.h>
#include <math.h>
#include <pthread.h>
#include <setjmp.h>
#include <stdarg.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

typedef void *Component;
typedef void *State;
typedef unsigned int Ref;
typedef enum { OK, WARNING, DISCARD, ERROR, FATAL, PENDING } Status;
typedef struct {
    void (*logger)(void *, const char *, Status, const char *, const char *, ...);
    void *(*allocate)(size_t, size_t);
    void (*release)(void *);
    void (*step_finished)(void *, Status);
    void *environment;
} Callbacks;

#define FUNCTIONS(X)                                                                                                       \
    X(const char *, GetTypesPlatform, (void))                                                                              \
    X(const char *, GetVersion, (void))                                                                                    \
    X(Status, SetDebugLogging, (Component, int, size_t, const char *const *))                                              \
    X(Component, Instantiate, (const char *, int, const char *, const char *, const Callbacks *, int, int))                \
    X(void, FreeInstance, (Component))                                                                                     \
    X(Status, SetupExperiment, (Component, int, double, double, int, double))                                              \
    X(Status, EnterInitializationMode, (Component))                                                                        \
    X(Status, ExitInitializationMode, (Component))                                                                         \
    X(Status, Terminate, (Component))                                                                                      \
    X(Status, Reset, (Component))                                                                                          \
    X(Status, GetReal, (Component, const Ref *, size_t, double *))                                                         \
    X(Status, GetInteger, (Component, const Ref *, size_t, int *))                                                         \
    X(Status, GetBoolean, (Component, const Ref *, size_t, int *))                                                         \
    X(Status, GetString, (Component, const Ref *, size_t, const char **))                                                  \
    X(Status, SetReal, (Component, const Ref *, size_t, const double *))                                                   \
    X(Status, SetInteger, (Component, const Ref *, size_t, const int *))                                                   \
    X(Status, SetBoolean, (Component, const Ref *, size_t, const int *))                                                   \
    X(Status, SetString, (Component, const Ref *, size_t, const char *const *))                                            \
    X(Status, GetFMUstate, (Component, State *))                                                                           \
    X(Status, SetFMUstate, (Component, State))                                                                             \
    X(Status, FreeFMUstate, (Component, State *))                                                                          \
    X(Status, SerializedFMUstateSize, (Component, State, size_t *))                                                        \
    X(Status, SerializeFMUstate, (Component, State, char *, size_t))                                                       \
    X(Status, DeSerializeFMUstate, (Component, const char *, size_t, State *))                                             \
    X(Status, GetDirectionalDerivative, (Component, const Ref *, size_t, const Ref *, size_t, const double *, double *))   \
    X(Status, SetRealInputDerivatives, (Component, const Ref *, size_t, const int *, const double *))                      \
    X(Status, GetRealOutputDerivatives, (Component, const Ref *, size_t, const int *, double *))                           \
    X(Status, DoStep, (Component, double, double, int))                                                                    \
    X(Status, CancelStep, (Component))                                                                                     \
    X(Status, GetStatus, (Component, int, Status *))                                                                       \
    X(Status, GetRealStatus, (Component, int, double *))                                                                   \
    X(Status, GetIntegerStatus, (Component, int, int *))                                                                   \
    X(Status, GetBooleanStatus, (Component, int, int *))                                                                   \
    X(Status, GetStringStatus, (Component, int, const char **))                                                            \
    X(Status, EnterEventMode, (Component))                                                                                 \
    X(Status, NewDiscreteStates, (Component, void *))                                                                      \
    X(Status, EnterContinuousTimeMode, (Component))                                                                        \
    X(Status, CompletedIntegratorStep, (Component, int, int *, int *))                                                     \
    X(Status, SetTime, (Component, double))                                                                                \
    X(Status, SetContinuousStates, (Component, const double *, size_t))                                                    \
    X(Status, GetDerivatives, (Component, double *, size_t))                                                               \
    X(Status, GetEventIndicators, (Component, double *, size_t))                                                           \
    X(Status, GetContinuousStates, (Component, double *, size_t))                                                          \
    X(Status, GetNominalsOfContinuousStates, (Component, double *, size_t))

#define DECLARE(type, name, arguments) static type(*name) arguments;
FUNCTIONS(DECLARE)

static int passed, failed;
static const char *model, *guid;
static Ref input, fixed, tunable, output, enumeration, driven;
static double beyond;

#define CHECK(what, condition) check(what, (condition) != 0, __LINE__)
static void check(const char *what, int good, int line) {
    if (good) passed++;
    else failed++, printf("FAILED %s line %d: %s\n", model, line, what);
}

/* What the log said last; one per thread, for instances log from the thread that calls them. */
static __thread char last[2048];
static __thread int lines, bad_category;
static int marker;
static void logger(void *environment, const char *name, Status status, const char *category, const char *message, ...) {
    static const char *const declared[] = {"logStatusError", "logStatusWarning", "logEvents", "logAll"};
    int known = 0;
    va_list arguments;
    for (int k = 0; category && k < 4; k++) known |= !strcmp(category, declared[k]);
    bad_category |= !known || environment != &marker || !name || status > PENDING;
    va_start(arguments, message);
    vsnprintf(last, sizeof last, message, arguments);
    va_end(arguments);
    lines++;
}
static void *forbidden_allocate(size_t n, size_t size) {
    (void)n, (void)size;
    puts("the importer's allocator was used");
    exit(3);
}
static void forbidden_release(void *p) {
    (void)p;
    puts("the importer's allocator was used");
    exit(3);
}
static const Callbacks callbacks = {logger, forbidden_allocate, forbidden_release, NULL, &marker};

/* Error with one more line in the log that holds all the given texts. */
static int refused(Status status, int lines_before, const char *a, const char *b) {
    return status == ERROR && lines > lines_before && strstr(last, a) && strstr(last, b);
}
#define REFUSED(what, call, a, b)                        \
    do {                                                 \
        int before_ = lines;                             \
        CHECK(what, refused((call), before_, (a), (b))); \
    } while (0)

static Component fresh(void) { return Instantiate("abused", 1, guid, NULL, &callbacks, 0, 0); }
static Component running(void) {
    Component c = fresh();
    SetupExperiment(c, 0, 0, 0, 0, 0), EnterInitializationMode(c), ExitInitializationMode(c);
    return c;
}
static double get(Component c, Ref r) {
    double x = NAN;
    GetReal(c, &r, 1, &x);
    return x;
}

static int load(const char *path, void **handle) {
    *handle = dlopen(path, RTLD_NOW | RTLD_LOCAL);
    if (!*handle) return printf("%s\n", dlerror()), 0;
#define RESOLVE(type, name, arguments) \
    if (!(name = (type(*) arguments)dlsym(*handle, "fmi2" #name))) return printf("fmi2" #name " is missing\n"), 0;
    FUNCTIONS(RESOLVE)
    return 1;
}

static void instantiation(void) {
    Callbacks other = callbacks;
    char longer[64], wrong[64], other_model[64];
    snprintf(longer, sizeof longer, "%s0", guid), snprintf(wrong, sizeof wrong, "{%s}", guid);
    CHECK("platform", !strcmp(GetTypesPlatform(), "default"));
    CHECK("version", !strcmp(GetVersion(), "2.0"));
    CHECK("callbacks NULL", !Instantiate("x", 1, guid, NULL, NULL, 0, 0));
    int n = lines;
    CHECK("name NULL", !Instantiate(NULL, 1, guid, NULL, &callbacks, 0, 0) && lines > n);
    CHECK("name empty", !Instantiate("", 1, guid, NULL, &callbacks, 0, 0));
    n = lines;
    CHECK("GUID NULL", !Instantiate("x", 1, NULL, NULL, &callbacks, 0, 0) && lines > n);
    CHECK("GUID wrong", !Instantiate("x", 1, "no", NULL, &callbacks, 0, 0) && strstr(last, guid));
    snprintf(other_model, sizeof other_model, "%s", guid), other_model[0] = guid[0] == '0' ? '1' : '0';
    CHECK("GUID of another interface", !Instantiate("x", 1, other_model, NULL, &callbacks, 0, 0));
    snprintf(other_model, sizeof other_model, "%s", guid), other_model[35] = 'g';
    CHECK("GUID with a tail that is none", !Instantiate("x", 1, other_model, NULL, &callbacks, 0, 0));
    other_model[35] = 0;
    CHECK("GUID cut short", !Instantiate("x", 1, other_model, NULL, &callbacks, 0, 0));
    CHECK("GUID longer", !Instantiate("x", 1, longer, NULL, &callbacks, 0, 0));
    CHECK("GUID in braces", !Instantiate("x", 1, wrong, NULL, &callbacks, 0, 0));
    CHECK("GUID not UTF-8", !Instantiate("x", 1, "\xff\xfe", NULL, &callbacks, 0, 0));
    n = lines;
    CHECK("model exchange", !Instantiate("x", 0, guid, NULL, &callbacks, 0, 0) && lines > n && strstr(last, "co-simulation"));
    CHECK("type beyond", !Instantiate("x", 7, guid, NULL, &callbacks, 0, 0));
    other.logger = NULL, other.environment = NULL;
    Component c = Instantiate("\xff", 1, guid, "file:///nowhere", &other, 0, 1);
    CHECK("no logger", c && SetupExperiment(c, 0, 0, NAN, 0, 0) == ERROR && SetupExperiment(c, 0, 0, 0, 0, 0) == OK);
    FreeInstance(c);
    memset(&other, 0x55, sizeof other);
    const char *uris[] = {"", "file:", "file:///", "file://", "http://x/y", "file:///%zz%", "file:///%ff", "file:///no%20where", "rel"};
    for (size_t k = 0; k < sizeof uris / sizeof *uris; k++) {
        n = lines;
        c = Instantiate("100%s %n", 1, guid, uris[k], &callbacks, 0, 0);
        CHECK(uris[k], c && lines > n && strstr(last, "start values"));
        FreeInstance(c);
    }
    FreeInstance(NULL);
    char not_ours[256] = {0};
    FreeInstance(not_ours);
    CHECK("not an instance", DoStep(not_ours, 0, 1e-3, 0) == ERROR);
}

static void null_component(void) {
    double x = 0;
    int i = 0;
    size_t n = 0;
    State s = NULL;
    const char *text = NULL;
    Status st = OK;
    Component bad[] = {NULL, (char *)&x + 1};
    for (int k = 0; k < 2; k++) {
        Component c = bad[k];
        Status all[] = {SetDebugLogging(c, 1, 0, NULL), SetupExperiment(c, 0, 0, 0, 0, 0), EnterInitializationMode(c),
            ExitInitializationMode(c), Terminate(c), Reset(c), GetReal(c, &input, 1, &x), GetInteger(c, &input, 1, &i),
            GetBoolean(c, &input, 1, &i), GetString(c, &input, 1, &text), SetReal(c, &input, 1, &x), SetInteger(c, &input, 1, &i),
            SetBoolean(c, &input, 1, &i), SetString(c, &input, 1, &text), GetFMUstate(c, &s), SetFMUstate(c, s), FreeFMUstate(c, &s),
            SerializedFMUstateSize(c, s, &n), SerializeFMUstate(c, s, (char *)&x, 8), DeSerializeFMUstate(c, (char *)&x, 8, &s),
            GetDirectionalDerivative(c, &input, 1, &input, 1, &x, &x), SetRealInputDerivatives(c, &input, 1, &i, &x),
            GetRealOutputDerivatives(c, &input, 1, &i, &x), DoStep(c, 0, 1e-3, 0), CancelStep(c), GetStatus(c, 0, &st),
            GetRealStatus(c, 2, &x), GetIntegerStatus(c, 0, &i), GetBooleanStatus(c, 3, &i), GetStringStatus(c, 1, &text),
            EnterEventMode(c), NewDiscreteStates(c, NULL), EnterContinuousTimeMode(c), CompletedIntegratorStep(c, 0, &i, &i),
            SetTime(c, 0), SetContinuousStates(c, &x, 1), GetDerivatives(c, &x, 1), GetEventIndicators(c, &x, 1),
            GetContinuousStates(c, &x, 1), GetNominalsOfContinuousStates(c, &x, 1)};
        for (size_t f = 0; f < sizeof all / sizeof *all; f++) CHECK("component NULL or misaligned", all[f] == ERROR);
    }
}

static void null_arguments(void) {
    Component c = running();
    double x[2] = {0};
    int i[2] = {0};
    size_t n = 0;
    State s = NULL;
    CHECK("saved", GetFMUstate(c, &s) == OK);
    REFUSED("GetReal vr", GetReal(c, NULL, 1, x), "GetReal", "NULL");
    REFUSED("GetReal value", GetReal(c, &output, 1, NULL), "GetReal", "NULL");
    REFUSED("GetInteger vr", GetInteger(c, NULL, 1, i), "GetInteger", "NULL");
    REFUSED("GetInteger value", GetInteger(c, &enumeration, 1, NULL), "GetInteger", "NULL");
    REFUSED("GetBoolean vr", GetBoolean(c, NULL, 1, i), "GetBoolean", "NULL");
    REFUSED("GetString vr", GetString(c, NULL, 1, (const char **)x), "GetString", "NULL");
    REFUSED("SetReal vr", SetReal(c, NULL, 1, x), "SetReal", "NULL");
    REFUSED("SetReal value", SetReal(c, &input, 1, NULL), "SetReal", "NULL");
    REFUSED("SetInteger value", SetInteger(c, &enumeration, 1, NULL), "SetInteger", "NULL");
    REFUSED("SetBoolean vr", SetBoolean(c, NULL, 1, i), "SetBoolean", "NULL");
    REFUSED("SetString value", SetString(c, &input, 1, NULL), "SetString", "NULL");
    REFUSED("GetFMUstate", GetFMUstate(c, NULL), "FMUstate", "NULL");
    REFUSED("SetFMUstate", SetFMUstate(c, NULL), "FMUstate", "NULL");
    REFUSED("size of NULL", SerializedFMUstateSize(c, NULL, &n), "FMUstate", "NULL");
    REFUSED("size into NULL", SerializedFMUstateSize(c, s, NULL), "size", "NULL");
    CHECK("size", SerializedFMUstateSize(c, s, &n) == OK && n > 64);
    REFUSED("serialize into NULL", SerializeFMUstate(c, s, NULL, n), "serializedState", "NULL");
    REFUSED("serialize too small", SerializeFMUstate(c, s, (char *)x, 8), "size", "8");
    REFUSED("deserialize NULL", DeSerializeFMUstate(c, NULL, n, &s), "serializedState", "NULL");
    REFUSED("deserialize into NULL", DeSerializeFMUstate(c, (char *)x, 8, NULL), "FMUstate", "NULL");
    REFUSED("deserialize without end", DeSerializeFMUstate(c, (char *)x, SIZE_MAX, &s), "size", "larger");
    CHECK("FreeFMUstate NULL", FreeFMUstate(c, NULL) == OK);
    State none = NULL;
    CHECK("FreeFMUstate of NULL", FreeFMUstate(c, &none) == OK);
    CHECK("no values", GetReal(c, NULL, 0, NULL) == OK && SetReal(c, NULL, 0, NULL) == OK && SetString(c, NULL, 0, NULL) == OK);
    REFUSED("count without end", GetReal(c, &output, SIZE_MAX, x), "nvr", "variables");
    REFUSED("misaligned", GetReal(c, &output, 1, (double *)((char *)x + 1)), "value", "memory");
    REFUSED("categories NULL", SetDebugLogging(c, 1, 1, NULL), "categories", "NULL");
    const char *names[] = {NULL, "logNothing"};
    REFUSED("category NULL", SetDebugLogging(c, 1, 1, names), "categories", "NULL");
    REFUSED("category unknown", SetDebugLogging(c, 1, 1, names + 1), "logNothing", "unknown");
    REFUSED("GetRealStatus NULL", GetRealStatus(c, 2, NULL), "value", "NULL");
    REFUSED("GetBooleanStatus NULL", GetBooleanStatus(c, 3, NULL), "value", "NULL");
    char not_ours[256] = {0};
    REFUSED("not a state", SetFMUstate(c, not_ours), "state", "pointer");
    CHECK("goes on", DoStep(c, 0, 1e-3, 0) == OK);
    CHECK("freed", FreeFMUstate(c, &s) == OK && s == NULL && FreeFMUstate(c, &s) == OK);
    FreeInstance(c);
}

static void order(void) {
    Component c = fresh();
    double x = 0;
    int i = 0;
    REFUSED("step before initialization", DoStep(c, 0, 1e-3, 0), "DoStep", "Instantiated");
    REFUSED("exit before enter", ExitInitializationMode(c), "Exit", "Instantiated");
    REFUSED("get before initialization", GetReal(c, &output, 1, &x), "GetReal", "Instantiated");
    REFUSED("terminate before", Terminate(c), "Terminate", "Instantiated");
    CHECK("reset at once", Reset(c) == OK && Reset(c) == OK);
    CHECK("enter", SetupExperiment(c, 1, 1e-6, 0, 1, 10) == OK && EnterInitializationMode(c) == OK);
    REFUSED("enter twice", EnterInitializationMode(c), "Enter", "Initialization");
    REFUSED("setup late", SetupExperiment(c, 0, 0, 0, 0, 0), "Setup", "Initialization");
    REFUSED("step in initialization", DoStep(c, 0, 1e-3, 0), "DoStep", "Initialization");
    CHECK("outputs in initialization", GetReal(c, &output, 1, &x) == OK && GetInteger(c, &enumeration, 1, &i) == OK && i >= 1);
    CHECK("exit", ExitInitializationMode(c) == OK);
    REFUSED("exit twice", ExitInitializationMode(c), "Exit", "StepComplete");
    CHECK("step", DoStep(c, 0, 1e-3, 0) == OK);
    CHECK("terminate", Terminate(c) == OK && GetReal(c, &output, 1, &x) == OK);
    REFUSED("step after the end", DoStep(c, 1e-3, 1e-3, 0), "DoStep", "Terminated");
    REFUSED("set after the end", SetReal(c, &input, 1, &x), "SetReal", "Terminated");
    REFUSED("terminate twice", Terminate(c), "Terminate", "Terminated");
    CHECK("reset", Reset(c) == OK && EnterInitializationMode(c) == OK && ExitInitializationMode(c) == OK && DoStep(c, 0, 1e-3, 0) == OK);
    REFUSED("cancel", CancelStep(c), "Cancel", "pending");
    REFUSED("directional derivative", GetDirectionalDerivative(c, &output, 1, &input, 1, &x, &x), "Directional", "not offered");
    i = 0, x = 1.0;
    REFUSED("input derivative of no order", SetRealInputDerivatives(c, &driven, 1, &i, &x), "order", "0");
    i = 2;
    int before = lines;
    CHECK("second derivative of an input", SetRealInputDerivatives(c, &driven, 1, &i, &x) == WARNING && lines == before + 1 && strstr(last, "order 2"));
    REFUSED("output derivatives", GetRealOutputDerivatives(c, &output, 1, &i, &x), "Derivatives", "not offered");
    i = 1, x = NAN;
    REFUSED("input derivative NaN", SetRealInputDerivatives(c, &driven, 1, &i, &x), "Derivatives", "not finite");
    REFUSED("derivative of no input", SetRealInputDerivatives(c, &fixed, 1, &i, &x), "Derivatives", "cannot");
    REFUSED("derivative without order", SetRealInputDerivatives(c, &driven, 1, NULL, &x), "order", "NULL");
    x = 1.0;
    CHECK("input derivative", SetRealInputDerivatives(c, &driven, 1, &i, &x) == OK && DoStep(c, 1e-3, 0.05, 0) == OK);
    REFUSED("event mode", EnterEventMode(c), "EventMode", "co-simulation");
    REFUSED("set time", SetTime(c, 0), "SetTime", "co-simulation");
    Status s;
    const char *text;
    CHECK("status", GetStatus(c, 0, &s) == DISCARD && GetStringStatus(c, 1, &text) == DISCARD);
    CHECK("last time", GetRealStatus(c, 2, &x) == OK && x == 1e-3 + 0.05);
    CHECK("terminated", GetBooleanStatus(c, 3, &i) == OK && i == 0);
    REFUSED("status of no kind", GetStatus(c, 9, &s), "GetStatus", "9");
    REFUSED("real status of no kind", GetRealStatus(c, 0, &x), "GetRealStatus", "kind");
    REFUSED("integer status", GetIntegerStatus(c, 0, &i), "GetIntegerStatus", "kind");
    FreeInstance(c);
    for (int k = 0; k < 4; k++) {
        double start[] = {NAN, INFINITY, 0, 0}, stop[] = {1, 1, -1, NAN};
        c = fresh();
        REFUSED("experiment", SetupExperiment(c, 0, 0, start[k], 1, stop[k]), "Setup", "Time");
        FreeInstance(c);
    }
}

static void values(void) {
    Component c = running();
    double x = 0, before = get(c, input), two[2] = {before, NAN};
    const double bad[] = {NAN, INFINITY, -INFINITY, beyond, -1e300};
    int i = 0;
    const char *text = "x";
    char name[32];
    for (size_t k = 0; k < sizeof bad / sizeof *bad; k++) {
        snprintf(name, sizeof name, "%s", isfinite(bad[k]) ? "outside" : "not finite");
        REFUSED("bad input", SetReal(c, &input, 1, &bad[k]), name, "stays");
        CHECK("input stays", get(c, input) == before);
    }
    Ref refs[2] = {input, input};
    REFUSED("all or none", SetReal(c, refs, 2, two), "not finite", "stays");
    for (Ref r = 50000; r < 50010; r++) REFUSED("unknown", GetReal(c, &r, 1, &x), "GetReal", "500");
    Ref none[] = {0, 0xffffffffu, 0x80000000u, 65535};
    for (int k = 0; k < 4; k++) {
        REFUSED("unknown get", GetReal(c, &none[k], 1, &x), "value reference", "");
        REFUSED("unknown set", SetReal(c, &none[k], 1, &x), "value reference", "");
        REFUSED("unknown integer", SetInteger(c, &none[k], 1, &i), "value reference", "");
        REFUSED("unknown boolean", GetBoolean(c, &none[k], 1, &i), "value reference", "");
        REFUSED("unknown string", GetString(c, &none[k], 1, &text), "value reference", "");
    }
    REFUSED("real as integer", GetInteger(c, &input, 1, &i), "Real", "type");
    REFUSED("real as boolean", SetBoolean(c, &input, 1, &i), "Real", "type");
    REFUSED("real as string", SetString(c, &input, 1, &text), "Real", "type");
    REFUSED("enumeration as real", GetReal(c, &enumeration, 1, &x), "Enumeration", "type");
    REFUSED("set an output", SetReal(c, &output, 1, &x), "output", "cannot");
    REFUSED("set an enumeration output", SetInteger(c, &enumeration, 1, &i), "output", "cannot");
    double value = get(c, fixed);
    REFUSED("fixed while running", SetReal(c, &fixed, 1, &value), "fixed", "cannot");
    value = get(c, tunable);
    CHECK("tunable while running", SetReal(c, &tunable, 1, &value) == OK && DoStep(c, 0, 1e-3, 0) == OK);
    REFUSED("tunable NaN", SetReal(c, &tunable, 1, two + 1), "not finite", "stays");
    double huge = 1e308;
    REFUSED("tunable absurd", SetReal(c, &tunable, 1, &huge), "outside", "to");
    CHECK("goes on", DoStep(c, 1e-3, 1e-3, 0) == OK && isfinite(get(c, output)));
    FreeInstance(c);
    c = fresh();
    value = get(c, fixed), x = NAN;
    REFUSED("fixed NaN", SetReal(c, &fixed, 1, &x), "not finite", "stays");
    huge = -1e308;
    REFUSED("fixed absurd", SetReal(c, &fixed, 1, &huge), "outside", "to");
    CHECK("initializes", EnterInitializationMode(c) == OK && ExitInitializationMode(c) == OK);
    FreeInstance(c);
}

static void steps(void) {
    Component c = fresh();
    SetupExperiment(c, 0, 0, 0, 1, 5.0), EnterInitializationMode(c), ExitInitializationMode(c);
    const double bad[] = {0.0, -0.0, -1e-3, NAN, INFINITY, -INFINITY, 1e300, 1e9};
    for (size_t k = 0; k < sizeof bad / sizeof *bad; k++) REFUSED("bad step", DoStep(c, 0, bad[k], 0), "communicationStepSize", "not made");
    const double points[] = {NAN, INFINITY, 1.0, -1.0, 1e300};
    for (size_t k = 0; k < 5; k++) REFUSED("bad point", DoStep(c, points[k], 1e-3, 0), "not made", "currentCommunicationPoint");
    CHECK("good step", DoStep(c, 0, 1e-3, 0) == OK);
    REFUSED("same point again", DoStep(c, 0, 1e-3, 0), "not made", "0.001");
    REFUSED("does not move the clock", DoStep(c, 1e-3, 1e-30, 0), "not made", "clock");
    REFUSED("beyond the end", DoStep(c, 1e-3, 6, 0), "stopTime", "not made");
    double t = 1e-3;
    int good = 1;
    for (int k = 1; k < 1000; k++) good &= DoStep(c, t, 1e-3, 0) == OK, t += 1e-3;
    CHECK("accumulated clock", good);
    good = 1;
    for (int k = 1000; k < 4999; k++) good &= DoStep(c, k * 1e-3, 1e-3, 0) == OK;
    CHECK("counted clock", good);
    CHECK("end with rounding", DoStep(c, 4.999, 1e-3 * (1 + 1e-9), 0) == OK);
    FreeInstance(c);
    c = running();
    CHECK("one long step", DoStep(c, 0, 100, 0) == OK && isfinite(get(c, output)));
    CHECK("one tiny step", DoStep(c, 100, 1e-9, 0) == OK && DoStep(c, 100 + 1e-9, 1e-3, 0) == OK);
    FreeInstance(c);
    c = fresh();
    SetupExperiment(c, 0, 0, -3600, 0, 0), EnterInitializationMode(c), ExitInitializationMode(c);
    CHECK("negative start", DoStep(c, -3600, 0.01, 0) == OK && DoStep(c, -3599.99, 0.01, 0) == OK);
    FreeInstance(c);
    /* The clock of the day: a jump is one there too, and its rounding is none. */
    const double begin = 1.7e9;
    c = fresh();
    SetupExperiment(c, 0, 0, begin, 0, 0), EnterInitializationMode(c), ExitInitializationMode(c);
    REFUSED("half a second ahead", DoStep(c, begin + 0.5, 1e-3, 0), "currentCommunicationPoint", "not made");
    REFUSED("ten microseconds back", DoStep(c, begin - 1e-5, 1e-3, 0), "currentCommunicationPoint", "not made");
    good = 1;
    for (int k = 0; k < 100; k++) good &= DoStep(c, begin + k * 1e-3, 1e-3, 0) == OK;
    t = begin + 0.1;
    for (int k = 0; k < 100; k++) good &= DoStep(c, t, 1e-3, 0) == OK, t += 1e-3;
    CHECK("late clock, counted and accumulated", good);
    REFUSED("shortest step", DoStep(c, t, 5e-324, 0), "communicationStepSize = 5e-324 s", "clock");
    CHECK("in few digits", strlen(last) < 200);
    FreeInstance(c);
}

static void states(int quick) {
    Component c = running(), d = running();
    State s = NULL, u = NULL, v = NULL;
    size_t n = 0, m = 0;
    DoStep(c, 0, 0.01, 0), GetFMUstate(c, &s), SerializedFMUstateSize(c, s, &n);
    char *bytes = malloc(n), *again = malloc(n);
    CHECK("serialize", SerializeFMUstate(c, s, bytes, n) == OK && SerializeFMUstate(c, s, again, n) == OK && !memcmp(bytes, again, n));
    int all = 1, untouched = 1;
    for (size_t k = 0; k < n; k++)
        for (int bit = quick ? (int)(k % 8) : 0; bit < (quick ? (int)(k % 8) + 1 : 8); bit++) {
            bytes[k] ^= (char)(1 << bit), u = (State)&marker;
            all &= DeSerializeFMUstate(d, bytes, n, &u) == ERROR;
            untouched &= u == (State)&marker;
            bytes[k] ^= (char)(1 << bit);
        }
    CHECK("every damaged byte is refused", all);
    CHECK("nothing is handed out for it", untouched && strstr(last, "damaged"));
    all = 1;
    for (size_t k = 0; k < n; k++) all &= DeSerializeFMUstate(d, bytes, k, &u) == ERROR;
    CHECK("every truncation is refused", all);
    char *zeros = calloc(n, 1);
    CHECK("zeros are refused", DeSerializeFMUstate(d, zeros, n, &u) == ERROR);
    free(zeros);
    u = (State)&marker; /* an uninitialized pointer must not be read */
    CHECK("deserialize", DeSerializeFMUstate(d, bytes, n, &u) == OK && SetFMUstate(d, u) == OK);
    all = 1;
    for (int k = 0; k < 200; k++) all &= DoStep(c, 0.01 + k * 0.01, 0.01, 0) == OK && DoStep(d, 0.01 + k * 0.01, 0.01, 0) == OK;
    all &= get(c, output) == get(d, output);
    GetFMUstate(c, &s), GetFMUstate(d, &v);
    SerializedFMUstateSize(c, s, &n), SerializedFMUstateSize(d, v, &m);
    char *one = malloc(n), *two = malloc(m);
    SerializeFMUstate(c, s, one, n), SerializeFMUstate(d, v, two, m);
    CHECK("bit-identical continuation", all && n == m && !memcmp(one, two, n));
    Component e = running();
    State fresh_state = NULL, reset_state = NULL;
    Reset(d), GetFMUstate(d, &reset_state), FreeInstance(e), e = fresh(), GetFMUstate(e, &fresh_state);
    SerializedFMUstateSize(d, reset_state, &n), SerializedFMUstateSize(e, fresh_state, &m);
    one = realloc(one, n), two = realloc(two, m);
    SerializeFMUstate(d, reset_state, one, n), SerializeFMUstate(e, fresh_state, two, m);
    CHECK("reset equals fresh, bit for bit", n == m && !memcmp(one, two, n));
    FreeFMUstate(d, &u), FreeFMUstate(d, &v), FreeFMUstate(c, &s), FreeFMUstate(d, &reset_state), FreeFMUstate(e, &fresh_state);
    FreeInstance(c), FreeInstance(d), FreeInstance(e), free(bytes), free(again), free(one), free(two);
}

static void many(int count) {
    int good = 1;
    for (int k = 0; k < count; k++) {
        Component c = fresh();
        good &= c != NULL;
        if (k % 100 == 0) EnterInitializationMode(c), ExitInitializationMode(c), good &= DoStep(c, 0, 1e-3, 0) == OK;
        FreeInstance(c);
    }
    CHECK("instantiations", good);
    Component all[200];
    for (int k = 0; k < 200; k++) all[k] = running();
    for (int k = 0; k < 200; k++) good &= DoStep(all[k], 0, 0.05, 0) == OK;
    for (int k = 1; k < 200; k++) good &= get(all[k], output) == get(all[0], output);
    for (int k = 0; k < 200; k++) FreeInstance(all[k]);
    CHECK("instances side by side", good);
}

static void *work(void *result) {
    double sum = 0;
    for (int run = 0; run < 20; run++) {
        Component c = running();
        for (int k = 0; k < 50; k++) sum += DoStep(c, k * 0.01, 0.01, 0);
        sum += get(c, output);
        FreeInstance(c);
    }
    *(double *)result = sum;
    return NULL;
}
static void threads(void) {
    pthread_t thread[8];
    double result[8];
    int good = 1;
    for (int k = 0; k < 8; k++) pthread_create(&thread[k], NULL, work, &result[k]);
    for (int k = 0; k < 8; k++) pthread_join(thread[k], NULL), good &= result[k] == result[0];
    CHECK("threads agree", good);
}

/* All of an instance's life in a task with a small stack, whose depth is read off a pattern. */
enum { SMALL_STACK = 64 * 1024, PATTERN = 0x5a };
static char small_stack[SMALL_STACK] __attribute__((aligned(4096)));
static void *live(void *result) {
    Component c = fresh();
    State s = NULL, u = NULL;
    size_t n = 0;
    double x = NAN;
    int good = c && Reset(c) == OK && EnterInitializationMode(c) == OK && ExitInitializationMode(c) == OK && DoStep(c, 0, 0.05, 0) == OK;
    good &= GetFMUstate(c, &s) == OK && SerializedFMUstateSize(c, s, &n) == OK;
    char *bytes = malloc(n);
    good &= SerializeFMUstate(c, s, bytes, n) == OK && DeSerializeFMUstate(c, bytes, n, &u) == OK && SetFMUstate(c, u) == OK;
    good &= SetReal(c, &input, 1, &x) == ERROR && Reset(c) == OK;
    FreeFMUstate(c, &s), FreeFMUstate(c, &u), FreeInstance(c), free(bytes);
    *(int *)result = good;
    return NULL;
}
static void stack(int quick) {
    pthread_attr_t attributes;
    pthread_t thread;
    int good = 0, untouched = 0;
    memset(small_stack, PATTERN, sizeof small_stack);
    pthread_attr_init(&attributes), pthread_attr_setstack(&attributes, small_stack, sizeof small_stack);
    CHECK("small task", !pthread_create(&thread, &attributes, live, &good) && !pthread_join(thread, NULL) && good);
    /* Valgrind holds a stack that is left for undefined. */
    if (quick) return;
    while (untouched < SMALL_STACK && small_stack[untouched] == PATTERN) untouched++;
    printf("stack: %d bytes; ", SMALL_STACK - untouched);
    CHECK("half of 64 kB is enough", SMALL_STACK - untouched < SMALL_STACK / 2);
}

static void traps(void) {
    feenableexcept(FE_INVALID | FE_DIVBYZERO | FE_OVERFLOW);
    Component c = running();
    double x = NAN;
    Ref r = input;
    int good = DoStep(c, 0, 1e-3, 0) == OK && SetReal(c, &r, 1, &x) == ERROR && DoStep(c, 1e-3, NAN, 0) == ERROR;
    for (int k = 1; k < 3000; k++) {
        double u = 4.0 + 5.0 * (k % 1000) / 1000.0;
        SetReal(c, &r, 1, &u), good &= DoStep(c, k * 1e-3, 1e-3, 0) == OK;
    }
    CHECK("floating-point traps", good && GetReal(c, &output, 1, &x) == OK);
    FreeInstance(c);
    fedisableexcept(FE_ALL_EXCEPT);
}

static Component reentered;
static Status inner = OK;
static int free_within;
static void reenter(void *environment, const char *name, Status status, const char *category, const char *message, ...) {
    (void)environment, (void)name, (void)status, (void)category, (void)message;
    if (reentered) inner = free_within ? SetDebugLogging(reentered, 0, 0, NULL) : DoStep(reentered, 0, 1e-3, 0);
    if (reentered && free_within) FreeInstance(reentered);
}
static jmp_buf before_call;
static int armed;
static void jump(void *environment, const char *name, Status status, const char *category, const char *message, ...) {
    (void)environment, (void)name, (void)status, (void)category, (void)message;
    if (armed) longjmp(before_call, 1);
}
static void loggers(void) {
    Callbacks other = {reenter, NULL, NULL, NULL, NULL};
    reentered = NULL;
    Component c = Instantiate("x", 1, guid, NULL, &other, 0, 1);
    EnterInitializationMode(c), ExitInitializationMode(c);
    reentered = c;
    CHECK("a logger may call back", DoStep(c, 0, NAN, 0) == ERROR && inner == OK && DoStep(c, 1e-3, 1e-3, 0) == OK);
    free_within = 1;
    CHECK("and free the instance", DoStep(c, 0, NAN, 0) == ERROR && inner == OK);
    reentered = NULL, free_within = 0, other.logger = jump;
    c = Instantiate("x", 1, guid, NULL, &other, 0, 1);
    EnterInitializationMode(c), ExitInitializationMode(c), armed = 1;
    for (volatile int k = 0; k < 3; k++)
        if (!setjmp(before_call)) CHECK("jumped away", (DoStep(c, 0, NAN, 0), 0));
    CHECK("the instance is free after a logger that jumped away", DoStep(c, 0, 1e-3, 0) == OK);
    if (!setjmp(before_call)) CHECK("jumped away", (Instantiate("x", 7, guid, NULL, &other, 0, 0), 0));
    armed = 0;
    FreeInstance(c);
    c = running();
    CHECK("switched off", SetDebugLogging(c, 0, 0, NULL) == OK);
    int n = lines;
    CHECK("silent", DoStep(c, 0, NAN, 0) == ERROR && lines == n);
    const char *names[] = {"logStatusError", "logAll"};
    CHECK("switched on", SetDebugLogging(c, 1, 2, names) == OK && DoStep(c, 0, NAN, 0) == ERROR && lines > n);
    FreeInstance(c);
}

int main(int count, char **arguments) {
    if (count < 12) return puts("usage: see the head of abuse.c"), 2;
    const char *path = arguments[1];
    int quick = count > 12;
    model = arguments[2], guid = arguments[3];
    input = (Ref)atoi(arguments[4]), beyond = atof(arguments[5]), fixed = (Ref)atoi(arguments[6]);
    tunable = (Ref)atoi(arguments[7]), output = (Ref)atoi(arguments[8]), enumeration = (Ref)atoi(arguments[9]);
    driven = (Ref)atoi(arguments[10]);
    void *handle;
    int loads = 1;
    for (int k = 0; k < (quick ? 5 : 100); k++) {
        loads &= load(path, &handle);
        if (!loads) return 2;
        Component c = running();
        int n = lines;
        Component read = Instantiate("read", 1, guid, arguments[11], &callbacks, 0, 0);
        loads &= DoStep(c, 0, 1e-3, 0) == OK && read && lines == n;
        FreeInstance(c), FreeInstance(read);
        loads &= dlclose(handle) == 0;
    }
    CHECK("loaded and closed", loads);
    if (!load(path, &handle)) return 2;
    instantiation(), null_component(), null_arguments(), order(), values(), steps(), states(quick);
    many(quick ? 50 : 10000), threads(), traps(), loggers(), stack(quick);
    CHECK("categories are declared, environment and name passed through", !bad_category);
    dlclose(handle);
    printf("%d passed, %d failed\n", passed, failed);
    return failed != 0;
}
