/* For tests alone: Debian 12's wine lacks bcryptprimitives.dll, which every Windows has and Rust's std imports. */
#include <windows.h>

BOOLEAN NTAPI SystemFunction036(PVOID buffer, ULONG length);

__declspec(dllexport) BOOL WINAPI ProcessPrng(PBYTE buffer, SIZE_T length) {
    for (; length; buffer++, length--)
        if (!SystemFunction036(buffer, 1)) return FALSE;
    return TRUE;
}
