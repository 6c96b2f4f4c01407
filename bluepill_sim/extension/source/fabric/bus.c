/* The bus, for masters that are not the core (DMA): memory, and registers of any device, at the time of the event.
 *
 * Flash is read only, nothing else is there below the peripherals, and bit-band aliases are the core's alone.
 * Invariant: an access does what the same one of the core does at that time, code in SRAM included.
 * Source: RM0008 3.1, 3.3.2.
 */
#include <string.h>

#include "fabric.h"

/* Makes a memory known; `bytes` is Python's and stays where it is. */
bool fabric_add_memory(struct fabric *fabric, uint8_t *bytes, uint32_t base, uint32_t size, bool is_writable)
{
    if (fabric->memory_count == MEMORIES) {
        return false;
    }
    fabric->memories[fabric->memory_count++] = (struct memory){bytes, base, size, is_writable};
    return true;
}

bool is_memory(const struct fabric *fabric, uint32_t address, bool is_write)
{
    for (uint32_t n = 0; n < fabric->memory_count; ++n) {
        const struct memory *memory = &fabric->memories[n];
        if (address - memory->base < memory->size && (!is_write || memory->is_writable)) {
            return true;
        }
    }
    return false;
}

/* As memcpy of a word, or of less, without its call. */
static inline void copy(void *to, const void *from, uint32_t bytes)
{
    if (bytes == 4) {
        memcpy(to, from, 4);
    } else {
        memcpy(to, from, bytes);
    }
}

static bool reach_memory(struct fabric *fabric, struct bus_access *access)
{
    for (uint32_t n = fabric->memory_count; n-- > 0;) { /* mostly it is SRAM, the last one */
        const struct memory *memory = &fabric->memories[n];
        const uint32_t at = access->address - memory->base;
        if (at >= memory->size || (access->is_write && !memory->is_writable)) {
            continue;
        }
        if (!access->is_write) {
            access->word = 0;
            copy(&access->word, memory->bytes + at, access->bytes);
            return true;
        }
        const struct host *host = &fabric->host;
        copy(memory->bytes + at, &access->word, access->bytes);
        if (host->holds_code == NULL || host->holds_code(host->user, access->address, access->bytes)) {
            leave_ahead(fabric);
        fabric->calls.code_written(access->address, access->bytes);
        }
        return true;
    }
    return false;
}

static bool reach_registers(struct fabric *fabric, struct bus_access *access)
{
    const struct host *host = &fabric->host;
    if (host->registers != NULL && host->registers(host->user, access)) {
        return !access->is_error;
    }
    leave_ahead(fabric);
    const uint64_t answer = fabric->calls.bus(access->is_write, access->address, access->bytes, access->word);
    access->word = (uint32_t)answer;
    return answer != NO_TIME;
}

static bool reach(struct device *master, struct bus_access *access)
{
    struct fabric *fabric = master->fabric;
    if (access->address & (access->bytes - 1)) {
        return false;
    }
    if (access->address - PERIPHERALS >= PERIPHERALS_END - PERIPHERALS) {
        return reach_memory(fabric, access);
    }
    const uint32_t before = fabric->master;
    fabric->master = master->slot;
    const bool is_done = reach_registers(fabric, access);
    fabric->master = before;
    return is_done;
}

bool bus_read(struct device *master, uint32_t address, uint32_t bytes, uint32_t *word)
{
    struct bus_access access = {.address = address, .bytes = bytes};
    const bool is_done = reach(master, &access);
    *word = is_done ? access.word : 0;
    return is_done;
}

bool bus_write(struct device *master, uint32_t address, uint32_t bytes, uint32_t word)
{
    struct bus_access access = {.address = address, .bytes = bytes, .is_write = 1, .word = word};
    return reach(master, &access);
}

/* For a device in Python: the word, or NO_TIME. */
uint64_t fabric_bus(struct fabric *fabric, uint32_t slot, uint32_t is_write, uint32_t address, uint32_t bytes, uint32_t word)
{
    struct bus_access access = {.address = address, .bytes = bytes, .is_write = is_write, .word = word};
    return reach(&fabric->devices[slot], &access) ? access.word : NO_TIME;
}

/* The slot of the device whose access is under way; SLOTS for the core. */
uint32_t fabric_master(const struct fabric *fabric) { return fabric->master; }
