/* The functions of the CUDA driver that gauss calls, in the memory of this process, as strict as a driver may be.

   Every call but the first ones needs a current context; copies stay inside one allocation; streams are those that were
   created. Programs are run by a callback. After an injected failure the next call of that name returns its code. */
#define _GNU_SOURCE
#include <dlfcn.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

enum { INVALID_VALUE = 1, OUT_OF_MEMORY = 2, NOT_INITIALIZED = 3, INVALID_CONTEXT = 201, INVALID_HANDLE = 400, NOT_FOUND = 500 };
enum { DEVICES = 2, MOST = 4096, DEEPEST = 16 };
typedef int (*launch_t)(const char *text, const char *name, long threads, int device, void **params);
typedef struct { uintptr_t at; size_t size; int device; } room_t;
typedef struct { char *text; int device; } module_t;
typedef struct { module_t *module; char name[64]; } function_t;

static room_t rooms[MOST];
static int contexts[DEVICES], streams[4], begun, modules;
static size_t most_bytes = (size_t)1 << 30;
static __thread int stack[DEEPEST], depth;
static launch_t launch;
static char failing[64];
static int code;

static int failed(const char *name) {
  if (strcmp(name, failing)) return 0;
  failing[0] = 0;
  return code;
}
static int current(void) { return depth ? stack[depth - 1] : -1; }
#define BEGIN(name)                              \
  if (!begun) return NOT_INITIALIZED;            \
  { int found = failed(name); if (found) return found; }
#define NEED(name) BEGIN(name) if (current() < 0) return INVALID_CONTEXT;

/* for the test */
void stub_launch(launch_t given) { launch = given; }
void stub_fail(const char *name, int with) { snprintf(failing, sizeof failing, "%s", name); code = with; }
void stub_memory(size_t bytes) { most_bytes = bytes; }
uintptr_t stub_alloc(size_t bytes, int device) {  /* as another library does */
  uintptr_t found = 0;
  int cuMemAlloc_v2(uintptr_t *, size_t);
  stack[depth++] = device;
  cuMemAlloc_v2(&found, bytes);
  depth--;
  return found;
}
int stub_depth(void) { return depth; }
int stub_modules(void) { return modules; }
uintptr_t stub_room_of(uintptr_t p, int *device) {
  for (int k = 0; k < MOST; k++)
    if (rooms[k].at && rooms[k].at <= p && p < rooms[k].at + rooms[k].size) { *device = rooms[k].device; return rooms[k].at; }
  return 0;
}
int stub_rooms(void) {
  int count = 0;
  for (int k = 0; k < MOST; k++) count += rooms[k].at != 0;
  return count;
}

int cuInit(unsigned flags) { begun = 1; return flags ? INVALID_VALUE : failed("cuInit"); }
int cuDriverGetVersion(int *version) { *version = 13000; return 0; }
int cuDeviceGetCount(int *count) { BEGIN("cuDeviceGetCount") *count = DEVICES; return 0; }
int cuDeviceGet(int *device, int number) { BEGIN("cuDeviceGet") *device = number; return number < DEVICES ? 0 : 101; }
int cuDeviceGetName(char *name, int length, int device) { BEGIN("cuDeviceGetName") snprintf(name, length, "stub %d", device); return 0; }
int cuDeviceGetAttribute(int *value, int attribute, int device) {
  BEGIN("cuDeviceGetAttribute")
  if (device < 0 || device >= DEVICES) return 101;
  *value = attribute == 75 ? 9 : attribute == 76 ? 0 : attribute == 16 ? 132 : attribute == 39 ? 2048 : -1;
  return *value < 0 ? INVALID_VALUE : 0;
}
int cuDevicePrimaryCtxRetain(void **context, int device) { BEGIN("cuDevicePrimaryCtxRetain") *context = &contexts[device]; return 0; }
int cuCtxPushCurrent_v2(void *context) {
  BEGIN("cuCtxPushCurrent")
  if (depth == DEEPEST || (int *)context < contexts || (int *)context >= contexts + DEVICES) return INVALID_CONTEXT;
  stack[depth++] = (int)((int *)context - contexts);
  return 0;
}
int cuCtxPopCurrent_v2(void **context) { NEED("cuCtxPopCurrent") *context = &contexts[stack[--depth]]; return 0; }
int cuCtxSynchronize(void) { NEED("cuCtxSynchronize") return 0; }
static int is_stream(uintptr_t s) { return s <= 2 || (s >= (uintptr_t)streams && s < (uintptr_t)(streams + 4)); }
int cuStreamCreate(void **stream, unsigned flags) { static int made; NEED("cuStreamCreate") *stream = &streams[made++ % 4]; return flags > 1; }
int cuStreamSynchronize(uintptr_t stream) { NEED("cuStreamSynchronize") return is_stream(stream) ? 0 : INVALID_HANDLE; }
int cuMemGetInfo_v2(size_t *left, size_t *total) {
  NEED("cuMemGetInfo")
  size_t used = 0;
  for (int k = 0; k < MOST; k++) used += rooms[k].at && rooms[k].device == current() ? rooms[k].size : 0;
  *total = most_bytes, *left = used < most_bytes ? most_bytes - used : 0;
  return 0;
}
int cuMemAlloc_v2(uintptr_t *pointer, size_t size) {
  size_t left, total;
  NEED("cuMemAlloc")
  if (!size) return INVALID_VALUE;
  cuMemGetInfo_v2(&left, &total);
  if (size > left) return OUT_OF_MEMORY;
  for (int k = 0; k < MOST; k++)
    if (!rooms[k].at) {
      rooms[k].at = (uintptr_t)aligned_alloc(256, (size + 255) / 256 * 256);
      rooms[k].size = size, rooms[k].device = current();
      *pointer = rooms[k].at;
      return 0;
    }
  return OUT_OF_MEMORY;
}
int cuMemFree_v2(uintptr_t pointer) {
  NEED("cuMemFree")
  for (int k = 0; k < MOST; k++)
    if (rooms[k].at == pointer) { free((void *)pointer); rooms[k].at = 0; return 0; }
  return INVALID_VALUE;
}
static int inside(uintptr_t p, size_t size) {
  for (int k = 0; k < MOST; k++)
    if (rooms[k].at && rooms[k].at <= p && p + size <= rooms[k].at + rooms[k].size) return rooms[k].device == current();
  return 0;
}
int cuMemcpyHtoDAsync_v2(uintptr_t to, const void *from, size_t size, uintptr_t stream) {
  NEED("cuMemcpyHtoDAsync")
  if (!is_stream(stream)) return INVALID_HANDLE;
  if (!inside(to, size)) return INVALID_VALUE;
  memcpy((void *)to, from, size);
  return 0;
}
int cuMemcpyDtoHAsync_v2(void *to, uintptr_t from, size_t size, uintptr_t stream) {
  NEED("cuMemcpyDtoHAsync")
  if (!is_stream(stream)) return INVALID_HANDLE;
  if (!inside(from, size)) return INVALID_VALUE;
  memcpy(to, (void *)from, size);
  return 0;
}
int cuPointerGetAttribute(void *data, int attribute, uintptr_t pointer) {
  int device;
  NEED("cuPointerGetAttribute")
  if (attribute != 9 || !stub_room_of(pointer, &device)) return INVALID_VALUE;
  *(int *)data = device;
  return 0;
}
int cuModuleLoadDataEx(void **module, const void *image, unsigned count, int *options, void **values) {
  module_t *made = malloc(sizeof *made);
  NEED("cuModuleLoadDataEx")
  if (count != 2 || options[0] != 5 || options[1] != 6) return INVALID_VALUE;
  if (!strstr(image, ".version")) {
    snprintf(values[0], (uintptr_t)values[1], "ptxas: no PTX");
    return 218;
  }
  made->text = strdup(image), made->device = current();
  *module = made;
  modules++;
  return 0;
}
int cuModuleUnload(module_t *module) { NEED("cuModuleUnload") free(module->text); free(module); modules--; return 0; }
int cuModuleGetFunction(void **function, module_t *module, const char *name) {
  char entry[128];
  function_t *made = malloc(sizeof *made);
  NEED("cuModuleGetFunction")
  snprintf(entry, sizeof entry, ".entry %s(", name);
  if (!strstr(module->text, entry)) return NOT_FOUND;
  made->module = module;
  snprintf(made->name, sizeof made->name, "%s", name);
  *function = made;
  return 0;
}
int cuFuncGetAttribute(int *value, int attribute, function_t *function) {
  BEGIN("cuFuncGetAttribute")
  *value = attribute == 0 ? 256 : attribute == 3 ? 64 : -1;
  return !function || *value < 0 ? INVALID_VALUE : 0;
}
int cuLaunchKernel(function_t *f, unsigned x, unsigned y, unsigned z, unsigned bx, unsigned by, unsigned bz, unsigned shared,
                   uintptr_t stream, void **params, void **extra) {
  NEED("cuLaunchKernel")
  if (!x || x > 2147483647u || y != 1 || z != 1 || !bx || bx > 256 || by != 1 || bz != 1 || shared || extra) return INVALID_VALUE;
  if (!is_stream(stream)) return INVALID_HANDLE;
  if (f->module->device != current()) return INVALID_HANDLE;
  return launch ? launch(f->module->text, f->name, (long)x * bx, current(), params) : 0;
}
int cuGetProcAddress_v2(const char *name, void **found, int version, uint64_t flags, int *status) {
  char newer[128];
  snprintf(newer, sizeof newer, "%s_v2", name);
  *found = dlsym(RTLD_DEFAULT, newer);
  if (!*found) *found = dlsym(RTLD_DEFAULT, name);
  if (status) *status = *found ? 0 : 1;
  return *found ? 0 : NOT_FOUND;
}
