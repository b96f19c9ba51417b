/* The functions of FMI 2.0 for co-simulation over kisspoint.c, the library as wasm2c has made it into C99.
 *
 * Each instance has a library of its own, with its own memory: instances share nothing. Arguments are copied into that memory and results out
 * of it, through one room that is made with the instance. A panic of the library is a trap; the instance answers fmi2Fatal from then on.
 * Resources are not read from files: vehicle.h, written with the FMU, holds the text of resources/vehicle.json.
 */
#include "kisspoint.h"
#include "vehicle.h"
#include <stdlib.h>
#include <string.h>

#if defined _WIN32
#define EXPORT __declspec(dllexport)
#else
#define EXPORT __attribute__((visibility("default")))
#endif
#if defined FMI2_FUNCTION_PREFIX && !defined FMI2_OVERRIDE_FUNCTION_PREFIX
#define JOINED_(prefix, name) prefix##name
#define JOINED(prefix, name) JOINED_(prefix, name)
#define NAMED(name) JOINED(FMI2_FUNCTION_PREFIX, name)
#else
#define NAMED(name) name
#endif
#define LIBRARY(name) Z_MODELZ_##name
#define CALL(name, ...) LIBRARY(name)(&c->library, __VA_ARGS__)

enum { OK, WARNING, DISCARD, ERROR, FATAL };
enum { MOST = 1024, ROOM = MOST * 12 + 64 }; /* values in one call; bytes for their references and values */
typedef unsigned int Ref;
typedef void (*Logger)(void *, const char *, int, const char *, const char *, ...);
typedef struct {
    Logger logger;
    void *allocate, *release, *finished, *environment;
} Callbacks;
struct Z_env_instance_t {
    struct Instance *owner;
};
typedef struct Instance {
    Z_MODEL_instance_t library;
    struct Z_env_instance_t env;
    Callbacks callbacks;
    const char *name;
    u32 component, room;
    int dead;
} Instance;
typedef struct {
    Instance *owner;
    u32 at;
} State;

static char *memory(Instance *c) { return (char *)LIBRARY(memory)(&c->library)->data; }

/* The library's logger. The message is copied, for the importer's logger may call back. */
void Z_envZ_kisspoint_log(struct Z_env_instance_t *env, u32 environment, u32 name, u32 status, u32 category, u32 message) {
    Instance *c = env->owner;
    char text[1024], kind[32];
    (void)environment, (void)name;
    strncpy(text, memory(c) + message, sizeof text - 1), text[sizeof text - 1] = 0;
    strncpy(kind, memory(c) + category, sizeof kind - 1), kind[sizeof kind - 1] = 0;
    if (c->callbacks.logger) c->callbacks.logger(c->callbacks.environment, c->name, (int)status, kind, text);
}

/* Runs a call of the library; a trap ends here. */
#define GUARDED(result, ...)                                      \
    do {                                                          \
        if (!c || c->dead) return ERROR;                          \
        jmp_buf here, *before = way_out;                          \
        if (setjmp(here)) return way_out = before, c->dead = 1, FATAL; \
        way_out = &here;                                          \
        (result) = (__VA_ARGS__);                                 \
        way_out = before;                                         \
    } while (0)

static u32 copied(Instance *c, u32 at, const void *from, size_t bytes) {
    if (!from) return 0;
    memcpy(memory(c) + at, from, bytes);
    return at;
}

static u32 text(Instance *c, const char *from) {
    if (!from) return 0;
    u32 at = CALL(kisspoint_allocate, (u32)strlen(from) + 1);
    return copied(c, at, from, strlen(from) + 1);
}

static void discard(Instance *c) {
    Z_MODEL_free(&c->library);
    free((void *)c->name), free(c);
}

EXPORT const char *NAMED(fmi2GetTypesPlatform)(void) { return "default"; }
EXPORT const char *NAMED(fmi2GetVersion)(void) { return "2.0"; }

EXPORT void *NAMED(fmi2Instantiate)(const char *name, int type, const char *guid, const char *location, const Callbacks *callbacks, int visible, int logging) {
    static int started;
    Instance *c;
    u32 functions;
    jmp_buf here, *before = way_out;
    (void)location, (void)visible;
    if (!callbacks || !(c = calloc(1, sizeof *c))) return NULL;
    if (!started) Z_MODEL_init_module(), started = 1;
    c->callbacks = *callbacks, c->env.owner = c;
    c->name = name ? strcpy(malloc(strlen(name) + 1), name) : NULL;
    if (setjmp(here)) return way_out = before, NULL; /* what it held is lost with it */
    way_out = &here;
    Z_MODEL_instantiate(&c->library, &c->env);
    c->room = CALL(kisspoint_allocate, ROOM);
    functions = CALL(kisspoint_allocate, 20);
    memset(memory(c) + functions, 0, 20);
    u32 logger = LIBRARY(kisspoint_logger)(&c->library);
    memcpy(memory(c) + functions, &logger, 4);
    u32 of_name = text(c, name), of_guid = text(c, guid), of_location = text(c, "data:application/json," KISSPOINT_VEHICLE);
    c->component = CALL(fmi2Instantiate, of_name, (u32)type, of_guid, of_location, functions, 0, (u32)logging);
    way_out = before;
    return c->component ? c : (discard(c), NULL);
}

EXPORT void NAMED(fmi2FreeInstance)(void *component) {
    if (component) discard(component);
}

#define SIMPLE(name)                                             \
    EXPORT int NAMED(name)(void *component) {                    \
        Instance *c = component;                                 \
        u32 status;                                              \
        GUARDED(status, CALL(name, c->component));               \
        return (int)status;                                      \
    }
SIMPLE(fmi2EnterInitializationMode)
SIMPLE(fmi2ExitInitializationMode)
SIMPLE(fmi2Terminate)
SIMPLE(fmi2Reset)
SIMPLE(fmi2CancelStep)

EXPORT int NAMED(fmi2SetupExperiment)(void *component, int tolerance_defined, double tolerance, double start, int stop_defined, double stop) {
    Instance *c = component;
    u32 status;
    GUARDED(status, CALL(fmi2SetupExperiment, c->component, (u32)tolerance_defined, tolerance, start, (u32)stop_defined, stop));
    return (int)status;
}

EXPORT int NAMED(fmi2DoStep)(void *component, double point, double size, int no_set_state_before) {
    Instance *c = component;
    u32 status;
    GUARDED(status, CALL(fmi2DoStep, c->component, point, size, (u32)no_set_state_before));
    return (int)status;
}

/* References at the room's begin, values after them at a multiple of 8. */
#define VALUES(count) (c->room + (((u32)(count) * 4 + 7) & ~7u))
#define GET(name, type)                                                                                            \
    EXPORT int NAMED(name)(void *component, const Ref *vr, size_t n, type *value) {                                \
        Instance *c = component;                                                                                   \
        u32 status, at;                                                                                            \
        if (!c || n > MOST || (n && (!vr || !value))) return ERROR;                                                \
        at = VALUES(n), copied(c, c->room, vr, n * sizeof *vr);                                                    \
        GUARDED(status, CALL(name, c->component, c->room, (u32)n, at));                                            \
        if (status <= WARNING && n) memcpy(value, memory(c) + at, n * sizeof *value);                              \
        return (int)status;                                                                                        \
    }
#define SET(name, type)                                                                                            \
    EXPORT int NAMED(name)(void *component, const Ref *vr, size_t n, const type *value) {                          \
        Instance *c = component;                                                                                   \
        u32 status, at;                                                                                            \
        if (!c || n > MOST || (n && (!vr || !value))) return ERROR;                                                \
        at = VALUES(n), copied(c, c->room, vr, n * sizeof *vr), copied(c, at, value, n * sizeof *value);           \
        GUARDED(status, CALL(name, c->component, c->room, (u32)n, at));                                            \
        return (int)status;                                                                                        \
    }
GET(fmi2GetReal, double)
GET(fmi2GetInteger, int)
GET(fmi2GetBoolean, int)
SET(fmi2SetReal, double)
SET(fmi2SetInteger, int)
SET(fmi2SetBoolean, int)

EXPORT int NAMED(fmi2SetRealInputDerivatives)(void *component, const Ref *vr, size_t n, const int *order, const double *value) {
    Instance *c = component;
    u32 status, at, orders;
    if (!c || n > MOST / 2 || (n && (!vr || !order || !value))) return ERROR;
    at = VALUES(n), orders = at + (u32)n * 8;
    copied(c, c->room, vr, n * sizeof *vr), copied(c, at, value, n * sizeof *value), copied(c, orders, order, n * sizeof *order);
    GUARDED(status, CALL(fmi2SetRealInputDerivatives, c->component, c->room, (u32)n, orders, at));
    return (int)status;
}

EXPORT int NAMED(fmi2SetDebugLogging)(void *component, int on, size_t n, const char *const *categories) {
    Instance *c = component;
    u32 status;
    (void)categories;
    /* Categories are not told apart here: all are switched. */
    (void)n;
    GUARDED(status, CALL(fmi2SetDebugLogging, c->component, (u32)on, 0, 0));
    return (int)status;
}

/* A state is a handle of the library's and the instance that it lies in. */
EXPORT int NAMED(fmi2GetFMUstate)(void *component, void **state) {
    Instance *c = component;
    State *s = state ? *state : NULL;
    u32 status, handle = s ? s->at : 0;
    if (!c || !state || (s && s->owner != c)) return ERROR;
    copied(c, c->room, &handle, 4);
    GUARDED(status, CALL(fmi2GetFMUstate, c->component, c->room));
    if (status > WARNING) return (int)status;
    if (!s && !(s = *state = calloc(1, sizeof *s))) return ERROR;
    s->owner = c, memcpy(&s->at, memory(c) + c->room, 4);
    return (int)status;
}

EXPORT int NAMED(fmi2SetFMUstate)(void *component, void *state) {
    Instance *c = component;
    State *s = state;
    u32 status;
    if (!c || !s || s->owner != c) return ERROR;
    GUARDED(status, CALL(fmi2SetFMUstate, c->component, s->at));
    return (int)status;
}

EXPORT int NAMED(fmi2FreeFMUstate)(void *component, void **state) {
    Instance *c = component;
    State *s = state ? *state : NULL;
    u32 status;
    if (!s) return OK;
    if (s->owner != c) return ERROR;
    copied(c, c->room, &s->at, 4);
    GUARDED(status, CALL(fmi2FreeFMUstate, c->component, c->room));
    free(s), *state = NULL;
    return (int)status;
}

EXPORT int NAMED(fmi2SerializedFMUstateSize)(void *component, void *state, size_t *size) {
    Instance *c = component;
    State *s = state;
    u32 status, bytes;
    if (!c || !s || s->owner != c || !size) return ERROR;
    GUARDED(status, CALL(fmi2SerializedFMUstateSize, c->component, s->at, c->room));
    memcpy(&bytes, memory(c) + c->room, 4), *size = bytes;
    return (int)status;
}

EXPORT int NAMED(fmi2SerializeFMUstate)(void *component, void *state, char *bytes, size_t size) {
    Instance *c = component;
    State *s = state;
    u32 status, at;
    if (!c || !s || s->owner != c || !bytes || size > 1 << 20) return ERROR;
    GUARDED(at, CALL(kisspoint_allocate, (u32)size));
    GUARDED(status, CALL(fmi2SerializeFMUstate, c->component, s->at, at, (u32)size));
    if (status <= WARNING) memcpy(bytes, memory(c) + at, size);
    CALL(kisspoint_release, at, (u32)size);
    return (int)status;
}

EXPORT int NAMED(fmi2DeSerializeFMUstate)(void *component, const char *bytes, size_t size, void **state) {
    Instance *c = component;
    State *s;
    u32 status, at, none = 0;
    if (!c || !bytes || !state || size > 1 << 20) return ERROR;
    GUARDED(at, CALL(kisspoint_allocate, (u32)size));
    copied(c, at, bytes, size), copied(c, c->room, &none, 4);
    GUARDED(status, CALL(fmi2DeSerializeFMUstate, c->component, at, (u32)size, c->room));
    CALL(kisspoint_release, at, (u32)size);
    if (status > WARNING) return (int)status;
    if (!(s = *state = calloc(1, sizeof *s))) return ERROR;
    s->owner = c, memcpy(&s->at, memory(c) + c->room, 4);
    return (int)status;
}

EXPORT int NAMED(fmi2GetRealStatus)(void *component, int kind, double *value) {
    Instance *c = component;
    u32 status;
    if (!c || !value) return ERROR;
    GUARDED(status, CALL(fmi2GetRealStatus, c->component, (u32)kind, c->room));
    if (status <= WARNING) memcpy(value, memory(c) + c->room, 8);
    return (int)status;
}

/* What these FMUs have none of, or never know: no strings, no derivatives of outputs, no step that is pending. */
EXPORT int NAMED(fmi2GetString)(void *component, const Ref *vr, size_t n, const char **value) { return (void)vr, (void)value, component && !n ? OK : ERROR; }
EXPORT int NAMED(fmi2SetString)(void *component, const Ref *vr, size_t n, const char *const *value) { return (void)vr, (void)value, component && !n ? OK : ERROR; }
EXPORT int NAMED(fmi2GetDirectionalDerivative)(void *component, const Ref *z, size_t nz, const Ref *v, size_t nv, const double *dv, double *dz) {
    return (void)component, (void)z, (void)nz, (void)v, (void)nv, (void)dv, (void)dz, ERROR;
}
EXPORT int NAMED(fmi2GetRealOutputDerivatives)(void *component, const Ref *vr, size_t n, const int *order, double *value) {
    return (void)component, (void)vr, (void)n, (void)order, (void)value, ERROR;
}
EXPORT int NAMED(fmi2GetStatus)(void *component, int kind, int *value) { return (void)kind, (void)value, component ? DISCARD : ERROR; }
EXPORT int NAMED(fmi2GetIntegerStatus)(void *component, int kind, int *value) { return (void)component, (void)kind, (void)value, ERROR; }
EXPORT int NAMED(fmi2GetBooleanStatus)(void *component, int kind, int *value) {
    if (!component || kind != 3 || !value) return ERROR;
    return *value = 0, OK;
}
EXPORT int NAMED(fmi2GetStringStatus)(void *component, int kind, const char **value) { return (void)kind, (void)value, component ? DISCARD : ERROR; }
