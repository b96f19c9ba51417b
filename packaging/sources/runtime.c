/* What kisspoint.c asks of its surroundings: a memory, a table of functions, and a way out of a panic. C99, nothing of an operating system.
 *
 * A trap jumps to where the running call began. Threads that run instances at the same time need a compiler with thread-local variables.
 */
#include "wasm-rt.h"
#include <setjmp.h>
#include <stdarg.h>
#include <stdlib.h>
#include <string.h>

#if defined __GNUC__
#define OF_THREAD __thread
#elif defined _MSC_VER
#define OF_THREAD __declspec(thread)
#else
#define OF_THREAD
#endif

enum { PAGE = 65536, MOST_TYPES = 256, MOST_VALUES = 24 };

static OF_THREAD jmp_buf *way_out;
static struct {
    uint32_t parameters, results;
    int values[MOST_VALUES];
} types[MOST_TYPES];
static uint32_t known_types;

WASM_RT_NO_RETURN void wasm_rt_trap(wasm_rt_trap_t code) {
    if (!way_out) abort();
    longjmp(*way_out, (int)code ? (int)code : 1);
}

bool wasm_rt_is_initialized(void) { return true; }

/* The number of a function's type, counted from 1; equal types have equal numbers. */
uint32_t wasm_rt_register_func_type(uint32_t parameters, uint32_t results, ...) {
    va_list list;
    uint32_t k, at = known_types, n = parameters + results;
    if (n > MOST_VALUES || known_types == MOST_TYPES) abort();
    types[at].parameters = parameters, types[at].results = results;
    va_start(list, results);
    for (k = 0; k < n; k++) types[at].values[k] = va_arg(list, int);
    va_end(list);
    for (k = 0; k < known_types; k++)
        if (types[k].parameters == parameters && types[k].results == results && !memcmp(types[k].values, types[at].values, n * sizeof(int))) return k + 1;
    return ++known_types;
}

void wasm_rt_allocate_memory(wasm_rt_memory_t *memory, uint32_t pages, uint32_t most) {
    memory->data = calloc(pages, PAGE);
    if (!memory->data) abort();
    memory->pages = pages, memory->max_pages = most, memory->size = pages * PAGE;
}

uint32_t wasm_rt_grow_memory(wasm_rt_memory_t *memory, uint32_t more) {
    uint32_t before = memory->pages, pages = before + more;
    uint8_t *data;
    if (pages < before || pages > memory->max_pages || pages > 0xffff || !(data = realloc(memory->data, (size_t)pages * PAGE))) return 0xffffffffu;
    memset(data + (size_t)before * PAGE, 0, (size_t)more * PAGE);
    memory->data = data, memory->pages = pages, memory->size = pages * PAGE;
    return before;
}

void wasm_rt_free_memory(wasm_rt_memory_t *memory) { free(memory->data); }

void wasm_rt_allocate_funcref_table(wasm_rt_funcref_table_t *table, uint32_t elements, uint32_t most) {
    table->size = elements, table->max_size = most, table->data = calloc(elements, sizeof *table->data);
    if (elements && !table->data) abort();
}

void wasm_rt_free_funcref_table(wasm_rt_funcref_table_t *table) { free(table->data); }
