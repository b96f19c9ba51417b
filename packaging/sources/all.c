/* The one file to compile: the library, what it stands on, and the functions of FMI 2.0 over it. */
#define WASM_RT_MEMCHECK_SIGNAL_HANDLER 0
#define WASM_RT_USE_STACK_DEPTH_COUNT 0
#include "kisspoint.c"
#undef CALL
#undef LOAD_DATA
#include "runtime.c"
#include "fmi2_functions.c"
