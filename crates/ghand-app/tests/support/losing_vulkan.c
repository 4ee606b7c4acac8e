/* A Vulkan loader that hands every call on to the real one, but loses devices and runs out of memory where it is told.
 *
 * REAL_VULKAN   path of the real loader
 * LOSE_AT       numbers, separated by commas: the so manieth submission, counted over all devices, loses its device
 * LOSE_AFTER    the same, but the submission is taken, and the device is lost once somebody waits for it
 * REFUSE_FROM   allocations of so many bytes and more fail
 */
#include <dlfcn.h>
#include <stdint.h>
#include <stdlib.h>
#include <string.h>

typedef void (*Function)(void);
typedef int32_t Result;
enum { OUT_OF_DEVICE_MEMORY = -2, DEVICE_LOST = -4 };

static Function (*real_instance_proc)(void *, const char *);
static Function (*real_device_proc)(void *, const char *);
static Result (*real_create_device)(void *, const void *, const void *, void **);
static Result (*real_allocate)(void *, const void *, const void *, void *);
static Result (*real_queue_wait_idle)(void *);
static Result (*real_device_wait_idle)(void *);
static Result (*real_submit)(void *, uint32_t, const void *, uint64_t);
static Result (*real_wait_semaphores)(void *, const void *, uint64_t);
static Result (*real_semaphore_value)(void *, uint64_t, void *);
static Result (*real_wait_fences)(void *, uint32_t, const void *, uint32_t, uint64_t);
static Result (*real_fence_status)(void *, uint64_t);
static Result (*real_acquire)(void *, uint64_t, uint64_t, uint64_t, uint64_t, void *);
static Result (*real_present)(void *, const void *);

static long submissions;
static int lost;
static int doomed;

static int time_to_lose(const char *variable) {
    const char *list = getenv(variable);
    while (list && *list) {
        char *end;
        if (strtol(list, &end, 10) == submissions)
            return 1;
        list = *end ? end + 1 : end;
    }
    return 0;
}

static Result create_device(void *adapter, const void *info, const void *allocator, void **device) {
    lost = doomed = 0;
    return real_create_device(adapter, info, allocator, device);
}

static Result allocate(void *device, const void *info, const void *allocator, void *memory) {
    const char *from = getenv("REFUSE_FROM");
    uint64_t size;
    memcpy(&size, (const char *)info + 16, sizeof size);
    if (from && size >= strtoull(from, NULL, 10))
        return OUT_OF_DEVICE_MEMORY;
    return real_allocate(device, info, allocator, memory);
}

static Result queue_wait_idle(void *queue) {
    Result result = real_queue_wait_idle(queue);
    return lost ? DEVICE_LOST : result;
}

static Result device_wait_idle(void *device) {
    Result result = real_device_wait_idle(device);
    return lost ? DEVICE_LOST : result;
}

static Result submit(void *queue, uint32_t count, const void *submits, uint64_t fence) {
    submissions++;
    if (lost)
        return DEVICE_LOST;
    if (time_to_lose("LOSE_AT")) {
        /* Nothing may still run when the program frees what it uses. */
        real_queue_wait_idle(queue);
        lost = 1;
        return DEVICE_LOST;
    }
    doomed |= time_to_lose("LOSE_AFTER");
    return real_submit(queue, count, submits, fence);
}

static Result wait_semaphores(void *device, const void *info, uint64_t timeout) {
    Result result = lost ? DEVICE_LOST : real_wait_semaphores(device, info, timeout);
    lost |= doomed;
    return lost ? DEVICE_LOST : result;
}

static Result semaphore_value(void *device, uint64_t semaphore, void *value) {
    return lost ? DEVICE_LOST : real_semaphore_value(device, semaphore, value);
}

static Result wait_fences(void *device, uint32_t count, const void *fences, uint32_t all, uint64_t timeout) {
    Result result = lost ? DEVICE_LOST : real_wait_fences(device, count, fences, all, timeout);
    lost |= doomed;
    return lost ? DEVICE_LOST : result;
}

static Result fence_status(void *device, uint64_t fence) {
    return lost ? DEVICE_LOST : real_fence_status(device, fence);
}

static Result acquire(void *device, uint64_t chain, uint64_t timeout, uint64_t semaphore, uint64_t fence, void *index) {
    return lost ? DEVICE_LOST : real_acquire(device, chain, timeout, semaphore, fence, index);
}

static Result present(void *queue, const void *info) {
    return lost ? DEVICE_LOST : real_present(queue, info);
}

static const struct {
    const char *name;
    void **real;
    void *mine;
} replaced[] = {
    {"vkAllocateMemory", (void **)&real_allocate, (void *)allocate},
    {"vkQueueWaitIdle", (void **)&real_queue_wait_idle, (void *)queue_wait_idle},
    {"vkDeviceWaitIdle", (void **)&real_device_wait_idle, (void *)device_wait_idle},
    {"vkQueueSubmit", (void **)&real_submit, (void *)submit},
    {"vkWaitSemaphores", (void **)&real_wait_semaphores, (void *)wait_semaphores},
    {"vkWaitSemaphoresKHR", (void **)&real_wait_semaphores, (void *)wait_semaphores},
    {"vkGetSemaphoreCounterValue", (void **)&real_semaphore_value, (void *)semaphore_value},
    {"vkGetSemaphoreCounterValueKHR", (void **)&real_semaphore_value, (void *)semaphore_value},
    {"vkWaitForFences", (void **)&real_wait_fences, (void *)wait_fences},
    {"vkGetFenceStatus", (void **)&real_fence_status, (void *)fence_status},
    {"vkAcquireNextImageKHR", (void **)&real_acquire, (void *)acquire},
    {"vkQueuePresentKHR", (void **)&real_present, (void *)present},
    {"vkCreateDevice", (void **)&real_create_device, (void *)create_device},
};

static Function replace(const char *name, Function real) {
    for (size_t i = 0; real && i < sizeof replaced / sizeof *replaced; i++) {
        if (!strcmp(name, replaced[i].name)) {
            *replaced[i].real = (void *)real;
            return (Function)replaced[i].mine;
        }
    }
    return real;
}

static Function device_proc(void *device, const char *name) {
    return replace(name, real_device_proc(device, name));
}

__attribute__((visibility("default"))) Function vkGetInstanceProcAddr(void *instance, const char *name) {
    if (!real_instance_proc) {
        const char *path = getenv("REAL_VULKAN");
        void *library = path ? dlopen(path, RTLD_NOW | RTLD_LOCAL) : NULL;
        *(void **)&real_instance_proc = library ? dlsym(library, "vkGetInstanceProcAddr") : NULL;
    }
    if (!real_instance_proc)
        return NULL;
    if (!strcmp(name, "vkGetInstanceProcAddr"))
        return (Function)vkGetInstanceProcAddr;
    Function real = real_instance_proc(instance, name);
    if (!strcmp(name, "vkGetDeviceProcAddr")) {
        *(void **)&real_device_proc = (void *)real;
        return real ? (Function)device_proc : NULL;
    }
    return replace(name, real);
}
